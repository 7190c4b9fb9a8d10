// The worker: it keeps the compiled module, and makes a new instance of it for each run, so that a run depends on nothing
// but the values that it is given. A component that refuses something says why itself.
"use strict";
let plan, compiling, compiled;
const PATIENCE = 100; // milliseconds after which the first run shows what there is
const PIECES = 50; // of a first run, at most

onmessage = async ({ data }) => {
  if (data.plan) {
    plan = data.plan;
    compiling = unpacked(data.module).then((stream) => WebAssembly.compile(stream));
    return;
  }
  try {
    compiled ??= await compiling;
    const done = run(data.values, data.isFirst);
    postMessage(done, [done.record.buffer]);
  } catch (error) {
    postMessage({ refused: error.message });
  }
};

async function unpacked(text) {
  const bytes = Uint8Array.fromBase64?.(text) ?? Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"))).arrayBuffer();
}

// `values`: by component, those that differ from the scenario's, as [reference, kind, value].
function run(values, isFirst) {
  const begun = performance.now();
  let told = begun;
  const said = [];
  let module;
  const bytes = (at, size) => new Uint8Array(module.memory.buffer, at, size);
  const say = (at) => {
    const rest = bytes(at);
    said.push(new TextDecoder().decode(rest.subarray(0, rest.indexOf(0))).replaceAll("%%", "%"));
  };
  const put = (text) => {
    const content = new TextEncoder().encode(text + "\0");
    const at = module.room(content.length);
    bytes(at, content.length).set(content);
    return [at, content.length - 1];
  };
  const fail = (text) => {
    throw new Error(text);
  };
  const check = (refused) => refused && fail(said.join(" "));
  const give = (part, [reference, kind, value]) =>
    kind === TEXT ? module.set_text(part, reference, put(value)[0]) : module.set_number(part, kind, reference, Number(value));

  const tune = (of, value, names) => {
    if (give(of.part, [of.reference, of.kind, value]))
      fail(`${said.join(" ").replace(/\.$/, "")}; event ${names} sets \`${of.target}\` to ${value}.`);
  };
  const stopped = (part, step) => {
    const { name } = plan.components[part];
    const lost = director.losing(part).map((event) => `\`${event}\``).join(" and ");
    const cause = said.join(" ") || `\`${name}\` stopped the run after base step ${step}: it refused, or an output is not finite.`;
    return lost ? `${cause} Event ${lost} gives it NaN. If it does not accept NaN, use \`stuck\`.` : cause;
  };

  module = new WebAssembly.Instance(compiled, { page: { say } }).exports;
  module._initialize();
  for (const [path, text] of Object.entries(plan.files)) module.give_file(put(path)[0], ...put(text));
  check(module.open());
  plan.components.forEach((own, part) => [...own.values, ...(values[part] || [])].forEach((one) => check(give(part, one))));
  const director = directorOf(module, plan.events, tune);
  director.turn(-1);
  for (const [place, value] of plan.inputs) new Float64Array(module.memory.buffer, module.inputs(), place + 1)[place] = value;
  check(module.start());
  const constants = Object.fromEntries(Object.entries(plan.constants).map(([name, at]) => [name, module.number(...at)]));
  director.begin();
  const recorded = () => new Float64Array(module.memory.buffer, module.record(), module.rows() * plan.signals.length).slice();
  const piece = isFirst ? Math.ceil(plan.count / PIECES) : plan.count;
  for (let done = -1, change = 0; done < plan.count; ) {
    if (module.advance(Math.min(change, done + piece, plan.count))) fail(stopped(module.acting(), module.done()));
    done = module.done();
    if (done < plan.count) change = director.turn(done);
    if (isFirst && performance.now() - told > PATIENCE) {
      postMessage({ isPart: true, record: recorded(), constants, events: director.happened });
      told = performance.now();
    }
  }
  return { record: recorded(), constants, events: director.happened, milliseconds: performance.now() - begun };
}

const TEXT = 3; // kind of a value, as model.h numbers them
