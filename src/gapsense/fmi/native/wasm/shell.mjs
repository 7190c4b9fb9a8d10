// Makes shell.wasm and shell_resources.wasm from fmi3.wit: the WebAssembly component around the module of an FMU, without
// that module, for FMUs without and with resources. Only after a change of fmi3.wit: npm install @bytecodealliance/jco@1.35.0;
// node shell.mjs FOLDER, where FOLDER is that of node_modules.
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";

const [modules, to = import.meta.dirname] = process.argv.slice(2);
const jco = await import(createRequire(`${modules}/`).resolve("@bytecodealliance/jco"));
const wit = readFileSync(new URL("fmi3.wit", import.meta.url), "utf8");
const MODULE = 1; // the kind of a section that holds a module
const EMPTY = Uint8Array.of(MODULE, 8, 0, 0x61, 0x73, 0x6d, 1, 0, 0, 0); // a module with nothing in it

/** The names of jco's dummy as wit-bindgen gives them, which are those that our C exports. */
const named = (text) =>
  text
    .replace(/"cm32p2\|_ex_([^"]*)@3" "([^"]*)_(drop|new|rep)"/g, '"[export]$1@3.0.0" "[resource-$3]$2"')
    .replace(/"cm32p2\|([^"|]*)@3"/g, '"$1@3.0.0"')
    .replace(/"cm32p2\|([^"|]*)@3\|([^"]*)_dtor"/g, '"$1@3.0.0#[dtor]$2"')
    .replace(/"cm32p2\|([^"|]*)@3\|([^"]*)_post"/g, '"cabi_post_$1@3.0.0#$2"')
    .replace(/"cm32p2\|([^"|]*)@3\|([^"]*)"/g, '"$1@3.0.0#$2"')
    .replace('"cm32p2_memory"', '"memory"')
    .replace('"cm32p2_realloc"', '"cabi_realloc"')
    .replace('"cm32p2_initialize"', '"_initialize"');

/** A number of at most 32 bits as WebAssembly writes it, and where it ends. */
const number = (bytes, at) => {
  let value = 0;
  for (let shift = 0; ; shift += 7) {
    value += (bytes[at] & 127) << shift;
    if (bytes[at++] < 128) return [value, at];
  }
};

/** A component with its first module, that of the FMU, emptied, and without sections of names. */
const emptied = (component) => {
  const kept = [component.slice(0, 8)];
  for (let at = 8, done = false; at < component.length; ) {
    const [size, start] = number(component, at + 1);
    const is_first = component[at] === MODULE && !done;
    if (is_first) kept.push(EMPTY);
    else if (component[at] !== 0) kept.push(component.slice(at, start + size));
    done ||= is_first;
    at = start + size;
  }
  return Buffer.concat(kept);
};

for (const [name, world] of [["shell.wasm", wit.replace("  import resource-dir-callbacks;\n", "")], ["shell_resources.wasm", wit]]) {
  const dummy = await jco.componentEmbed({ dummy: true, witSource: world, worldName: "co-simulation-fmu", metadata: [] });
  const text = named(await jco.print(dummy));
  const component = await jco.componentNew(await jco.parse(text), []);
  writeFileSync(`${to}/${name}`, emptied(component));
}
