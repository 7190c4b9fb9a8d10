// Events of a run, between two base steps, as events.py has them; what they are called and mean is explained there.
"use strict";
const NEVER = Infinity;

// `tune` gives a parameter a value: a number, since none of another type can be changed during a run.
function directorOf(module, events, tune) {
  const actors = events.map((of) => ({
    of, begin: of.begin ?? NEVER, end: of.end ?? NEVER, isOn: false, isArmed: true, since: null, isWatched: false, held: 0,
  }));
  const happened = []; // event, base steps of its begin and end
  const tuned = [...new Set(actors.filter(({ of }) => !of.lead).map(({ of }) => of.target))].map((target) => {
    const own = actors.filter(({ of }) => of.target === target);
    return { target, actors: own, of: own[0].of, nominal: null, last: null };
  });
  const buffer = () => new Float64Array(module.memory.buffer, module.inputs());

  const isWaiting = ({ of, begin }) => of.watch !== null && begin === NEVER;

  function turnOf(actor, k) {
    const { of } = actor;
    const m = k + of.lead;
    actor.isWatched = isWaiting(actor) && k >= of.after;
    if (actor.isWatched && fires(actor, k, module.holds(of.watch))) {
      actor.begin = m;
      actor.end = of.duration ? m + of.duration : NEVER;
    }
    const isOn = actor.begin <= m && m < actor.end;
    const change = isOn - actor.isOn;
    actor.isOn = isOn;
    if (change > 0) actor.held = before(actor, k);
    if (change < 0 && of.again) actor.begin = actor.end = NEVER;
    if (of.watch !== null) module.watch(of.watch, isWaiting(actor) && actor.isWatched, actor.since !== null);
    return change;
  }
  function fires(actor, k, holds) {
    if (!holds) return Object.assign(actor, { since: null, isArmed: true }) && false;
    actor.since ??= k;
    const isNow = actor.isArmed && k - actor.since >= actor.of.lasting;
    actor.isArmed &&= !isNow;
    return isNow;
  }

  // What it does to a value, as factor (null: whatever the value is) and bias; null while it is off.
  function effectOf({ of, isOn, begin, held }, m) {
    if (!isOn) return null;
    if (of.action === "stuck" || of.action === "dropout") return [null, of.action === "stuck" ? held : NaN];
    const share = of.action === "noise" ? noise(of, m) : m - begin >= of.over ? 1 : (m - begin) / of.over;
    if (of.action === "set" || (of.action === "ramp" && share >= 1)) return [null, of.value];
    if (of.action === "ramp") return [null, held + share * (of.value - held)];
    if (of.action === "scale") return [share >= 1 ? of.value : 1 + share * (of.value - 1), 0];
    return [1, of.value * share];
  }
  const noise = (of, m) => new Float64Array(module.memory.buffer, module.noise())[of.noise + m];
  const changed = (effect, value) => (effect ? (effect[0] === null ? effect[1] : effect[0] * value + effect[1]) : value);

  // The next base step after which its turn is needed.
  function due(actor, k) {
    const { of, begin, end } = actor;
    const m = k + of.lead;
    if (isWaiting(actor)) {
      if (!actor.isWatched) return Math.max(k + 1, of.after);
      return actor.isArmed && actor.since !== null ? actor.since + of.lasting : NEVER;
    }
    if (begin === NEVER || m >= end) return NEVER;
    if (m < begin) return begin - of.lead;
    return Math.min(end - of.lead, of.action === "noise" || m - begin < of.over ? following(of, k) : NEVER);
  }
  const sinceStep = ({ offset, step }, m) => (((m - offset) % step) + step) % step;
  const takes = (of, m) => m === 0 || (sinceStep(of, m) === 0 && m >= of.offset + of.first * of.step);
  function following(of, k) {
    const m = Math.max(k + of.lead + 1, of.offset + of.first * of.step);
    return m + ((of.step - sinceStep(of, m)) % of.step) - of.lead;
  }

  const before = (actor, k) => {
    if (actor.of.lead) return buffer()[actor.of.before];
    return valueOf(tuned.find(({ target }) => target === actor.of.target), k, actor);
  };
  function valueOf(own, k, until) {
    const known = own.actors.slice(0, until ? own.actors.indexOf(until) : undefined);
    return known.reduce((value, actor) => changed(effectOf(actor, k), value), own.nominal);
  }
  function stage(actor, effect) {
    const { part, link, before: source, held } = actor.of;
    if (effect && effect[0] === null) buffer()[held] = effect[1];
    const [factor, bias] = effect && effect[0] !== null ? effect : [1, 0];
    module.stage(part, link, effect && effect[0] === null ? held : source, effect !== null && effect[0] !== null, factor, bias);
  }
  function tuneAt(own, k) {
    const value = k >= 0 ? valueOf(own, k) : own.last;
    if (value === own.last) return NEVER;
    if (!takes(own.of, k)) return following(own.of, k);
    tune(own.of, value, own.actors.map(({ of }) => `\`${of.name}\``).join(" and "));
    own.last = value;
    return NEVER;
  }

  return {
    happened,
    begin() {
      for (const own of tuned) own.nominal = own.last = module.number(own.of.part, own.of.reference);
    },
    // Prepare what comes after base step k (-1: the initialization); the next one after which to do so again.
    turn(k) {
      for (const actor of actors) {
        const { of } = actor;
        const change = turnOf(actor, k);
        if (change > 0 && of.tells) happened.push([of.name, k + of.lead, null]);
        if (change < 0 && of.tells) happened.findLast(([name]) => name === of.name)[2] = k + of.lead;
        if (of.lead) stage(actor, effectOf(actor, k + of.lead));
      }
      const late = tuned.map((own) => tuneAt(own, k));
      return Math.min(...actors.map((actor) => due(actor, k)), ...late);
    },
    losing: (part) => actors.filter(({ of, isOn }) => isOn && of.action === "dropout" && of.part === part).map(({ of }) => of.name),
  };
}
