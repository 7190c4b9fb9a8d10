// Numbers as Gapsense writes them: in tables with a prefix, in files as Python's `repr`.
"use strict";

// The shortest digits that are this number, as Python writes them: exponents from 1e16 on and below 1e-4.
function pythonNumber(value) {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "nan" : value < 0 ? "-inf" : "inf";
  if (value === 0) return Object.is(value, -0) ? "-0.0" : "0.0";
  const [mantissa, power] = value.toExponential().split("e");
  const exponent = Number(power);
  if (exponent < -4 || exponent >= 16) {
    const digits = String(Math.abs(exponent)).padStart(2, "0");
    return `${mantissa}e${exponent < 0 ? "-" : "+"}${digits}`;
  }
  const sign = value < 0 ? "-" : "";
  const figures = mantissa.replace(/[-.]/g, "");
  if (exponent < 0) return `${sign}0.${"0".repeat(-exponent - 1)}${figures}`;
  const whole = figures.slice(0, exponent + 1).padEnd(exponent + 1, "0");
  return `${sign}${whole}.${figures.slice(exponent + 1) || "0"}`;
}

// As `%.4g` writes a number.
function fourDigits(value) {
  if (!Number.isFinite(value)) return pythonNumber(value);
  const [mantissa, power] = value.toExponential(3).split("e");
  const exponent = Number(power);
  if (value === 0) return Object.is(value, -0) ? "-0" : "0";
  if (exponent >= -4 && exponent < 4) return String(Number(value.toPrecision(4)));
  return `${Number(mantissa)}e${exponent < 0 ? "-" : "+"}${String(Math.abs(exponent)).padStart(2, "0")}`;
}

// The factor of the unit with the prefix that suits a value, and that unit.
function prefixed(value, unit, { prefixes, unprefixed }) {
  if (unprefixed.includes(unit)) return [1, unit];
  const [factor, prefix] = value ? prefixes.find(([f]) => Math.abs(value) >= f) || prefixes.at(-1) : prefixes[0];
  return [factor, prefix + unit];
}

function quantity(value, unit, plan) {
  const rounded = value && Number(value.toPrecision(4));
  if (unit === "" || unit === "1" || !Number.isFinite(value)) return fourDigits(rounded);
  const [factor, shown] = prefixed(rounded, unit, plan);
  return `${fourDigits(rounded / factor)} ${shown}`;
}

// A number times a power of ten, as if its digits were read again: 0.7 mm are 7e-4 m, to the last bit.
function shifted(value, exponent) {
  const [mantissa, power] = Number(value).toExponential().split("e");
  return Number(`${mantissa}e${Number(power) + exponent}`);
}

// The record as `gapsense run` saves it.
function csv(run, plan) {
  const heads = [["time", "s"], ...plan.signals].map(([name, unit]) => `"${unit ? `${name} [${unit}]` : name}"`);
  const columns = [run.times, ...plan.signals.map(([name]) => run.signals[name])];
  const lines = [heads.join(",")];
  for (let k = 0; k < run.rows; k++) lines.push(columns.map((column) => pythonNumber(column[k])).join(","));
  return lines.join("\n") + "\n";
}
