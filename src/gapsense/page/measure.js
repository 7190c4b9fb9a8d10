// Metrics of a run: which samples each looks at, and its number. As result.py and metrics.py.
"use strict";

// Signals by name over all times of the run, of a record row by row: NaN where it has not come yet.
function columnsOf({ record, ...more }, plan) {
  const width = plan.signals.length;
  const rows = Math.floor(plan.count / plan.decimation) + 1;
  const times = new Float64Array(rows).map((_, k) => plan.start + k * plan.decimation * plan.baseStep);
  const column = (place) => times.map((_, k) => record[k * width + place]);
  const signals = Object.fromEntries(plan.signals.map(([name], place) => [name, column(place)]));
  return { ...more, rows, times, signals };
}

const componentOf = (signal, plan) => plan.components.find(({ name }) => name === signal.split(".", 1)[0]);

// Between which times the samples of a metric lie; between none if it counts from an event that did not happen.
function windowOf({ event, after, before }, run, plan) {
  if (!event) return [after ?? -Infinity, before ?? Infinity];
  const found = run.events.find(([name]) => name === event);
  const begin = found ? plan.start + found[1] * plan.baseStep : Infinity;
  return [begin + (after ?? 0), before == null ? Infinity : begin + before];
}

// Rows at which the component of a signal has just stepped, inside of a window, and the times that they are about.
function samplesOf(metric, run, plan) {
  const { signal, where, time } = metric;
  const [after, before] = windowOf(metric, run, plan);
  const { step, offset } = componentOf(signal, plan);
  const slack = 1e-9 * plan.baseStep;
  const low = after + slack;
  const high = before - slack;
  const found = { rows: [], times: [] };
  for (let row = 0; row < run.rows; row++) {
    const since = row * plan.decimation - offset;
    if (since <= 0 || since % step || (where && run.signals[where][row] === 0)) continue;
    const at = time ? run.signals[time][row] : run.times[row];
    if (at > low && at < high) {
      found.rows.push(row);
      found.times.push(at);
    }
  }
  return found;
}

// The row of a time, undefined where there is none within half a row's step.
function rowAt(time, run, plan) {
  const row = Math.round((time - run.times[0]) / (plan.baseStep * plan.decimation));
  return row >= 0 && row < run.rows ? row : undefined;
}

// What the samples are compared with: a recorded signal, a parameter, a number, or nothing.
function referencesOf({ reference, time }, { rows, times }, run, plan) {
  if (typeof reference !== "string") return rows.map(() => reference ?? 0);
  const values = run.signals[reference];
  if (!values) return rows.map(() => run.constants[reference]);
  return rows.map((row, k) => (time ? values[rowAt(times[k], run, plan)] ?? NaN : values[row]));
}

const sum = (values) => values.reduce((total, value) => total + value, 0);
const mean = (values) => sum(values) / values.length;
const firstAbove = (values, times) => {
  const k = values.findIndex((value) => value > 0);
  return k < 0 ? Infinity : times[k];
};

const MEASURES = {
  rmse: (error) => Math.sqrt(mean(error.map((x) => x * x))),
  max_abs: (error) => error.reduce((most, x) => Math.max(most, Math.abs(x)), 0),
  mean_abs: (error) => mean(error.map(Math.abs)),
  mean,
  std: (error) => {
    const middle = mean(error);
    return Math.sqrt(mean(error.map((x) => (x - middle) ** 2)));
  },
  final: (error) => error.at(-1),
  min: (signal) => signal.reduce((least, x) => Math.min(least, x), Infinity),
  max: (signal) => signal.reduce((most, x) => Math.max(most, x), -Infinity),
  increase: (error) => error.at(-1) - error[0],
  fraction: (signal) => mean(signal.map((x) => Number(x !== 0))),
  until_above: firstAbove,
  until_below: (signal, times) => firstAbove(signal.map((x) => -x), times),
  loop_area: (y, x) => 0.5 * sum(y.map((_, k) => (x.at(k + 1 - x.length) + x[k]) * (y.at(k + 1 - y.length) - y[k]))),
  bond: (effort, other, flow, otherFlow) => {
    const leaving = effort.map((x, k) => x * flow[k]);
    const arriving = other.map((x, k) => x * otherFlow[k]);
    const through = 0.5 * sum(leaving.map((x, k) => Math.abs(x) + Math.abs(arriving[k])));
    return through > 0 ? sum(leaving.map((x, k) => Math.abs(x - arriving[k]))) / through : NaN;
  },
  intercept: (y, x) => {
    const crossed = [...y.keys()].slice(0, -1).filter((k) => x[k] < 0 !== x[k + 1] < 0);
    return mean(crossed.map((k) => Math.abs(y[k] - (x[k] * (y[k + 1] - y[k])) / (x[k + 1] - x[k]))));
  },
};

function measure(metric, run, plan) {
  const samples = samplesOf(metric, run, plan);
  if (!samples.rows.length) return NaN;
  const signal = samples.rows.map((row) => run.signals[metric.signal][row]);
  const references = referencesOf(metric, samples, run, plan);
  if (metric.flows) {
    const names = [metric.signal, metric.reference, ...metric.flows];
    const before = (row, k) => (metric.isLate[k] ? Math.max(row - 1, 0) : row);
    return MEASURES[metric.kind](...names.map((name, k) => samples.rows.map((row) => run.signals[name][before(row, k)])));
  }
  if (metric.isAxis) return MEASURES[metric.kind](signal, references);
  const [after] = windowOf(metric, run, plan);
  const since = samples.times.map((time) => time - (after === -Infinity ? plan.start : after));
  return MEASURES[metric.kind](signal.map((value, k) => value - references[k]), since);
}

const isInside = (value, bounds) =>
  bounds ? value >= (bounds[0] ?? -Infinity) && value <= (bounds[1] ?? Infinity) : Number.isFinite(value);
