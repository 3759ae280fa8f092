'use strict';
// The views of settings, loops, trace, set-up and console.

// --- views ---
function view(id) {
  views.forEach(section => section.classList.toggle('shown', section.id === id));
  document.querySelectorAll('nav button').forEach(tab => tab.setAttribute('aria-selected', tab.dataset.view === id));
  dispatchEvent(new Event('resize'));
  follow();
}
document.querySelector('nav').append(...views.map(section => {
  const tab = make('button', { textContent: section.dataset.name, onclick: () => view(section.id) });
  tab.dataset.view = section.id;
  tab.setAttribute('role', 'tab');
  return tab;
}));

// --- settings ---
let settings = [], compared = new Map();
const sayOfSettings = (text, bad) => { $('settings-said').textContent = text; $('settings-said').className = bad ? 'error' : ''; };
async function loadSettings() {
  try {
    const lines = await ask('describe');
    settings = lines.filter(line => line.startsWith('{')).map(line => JSON.parse(line));
    showSettings();
  } catch (error) { sayOfSettings(error.message, true); }
}
/** A field that stages a setting; a refused value goes back. */
function entry(s, to) {
  const fixed = s.change === 'board';
  const input = s.words.length ? make('select', { disabled: fixed }, ...s.words.map(word => make('option', { textContent: word, selected: word === s.value })))
    : make('input', { value: number7(s.value), disabled: fixed, inputMode: 'decimal' });
  input.setAttribute('aria-label', s.name);
  input.onchange = () => tell(`set ${s.name} ${input.value}`, to).then(loadSettings, () => { input.value = number7(s.value); });
  return input;
}
const sayOfPlate = (text, bad) => { $('plate-said').textContent = text; $('plate-said').className = bad ? 'error' : ''; };
const number7 = value => typeof value === 'number' ? +value.toPrecision(7) : value ?? '';
/** A number with its unit, in thousands or thousandths where it is large or small. */
function pretty(value, unit) {
  const size = Math.abs(value);
  if (typeof value !== 'number') return value;
  if (!/^(s|H|A|V|W|ohm|J)$/.test(unit) || !size || (size >= 0.01 && size < 1e5)) return `${number7(value)} ${unit}`.trim();
  const power = Math.max(-3, Math.min(2, Math.floor(Math.log10(size) / 3)));
  return `${+(value / 1000 ** power).toPrecision(5)} ${['n', 'µ', 'm', '', 'k', 'M'][power + 3]}${unit}`;
}
// Settings to set first, in this order.
const FIRST = ['nameplate.power_w', 'nameplate.voltage_v', 'nameplate.current_a', 'nameplate.frequency_hz', 'nameplate.speed_rpm', 'inverter.dc_link_v',
  'angle_source', 'sequence.flux', 'limits.current_a', 'speed.limit_rpm', 'speed.ramp_rpm_per_s', 'bus.commands'];
const TITLES = { first: 'Set these first', motor: 'Motor', inverter: 'Inverter', scales: 'Sensors', current_plant: 'Current loop', injection: 'Injection', observer: 'Observer', limits: 'Limits',
  sequence: 'Start and stop', speed: 'Speed and position', braking: 'Braking', vf: 'V/f control', bus: 'Field bus', other: 'Other', board: 'Board' };
const groupOf = s => FIRST.includes(s.name) ? 'first' : s.change === 'board' ? 'board' : s.name.split('.')[0] in TITLES ? s.name.split('.')[0] : 'other';
const opened = new Set(['first']);
function showSettings() {
  const wanted = $('filter').value.toLowerCase();
  const shown = settings.filter(s => (s.name + s.help).toLowerCase().includes(wanted))
    .filter(s => !$('changed').checked || s.value !== s.default || s.staged || compared.has(s.name));
  const row = s => {
    const effective = s.value === 'auto' && s.effective != null ? s.effective : s.value, plain = `${number7(effective)} ${s.unit}`.trim();
    const said = s.words.length || (s.value !== 'auto' && pretty(effective, s.unit) === plain) ? '' : ` = ${pretty(effective, s.unit)}`;
    const range = s.min == null ? s.words.join(', ') : `${pretty(s.min, s.unit)} to ${pretty(s.max, s.unit)}${s.auto ? ', or auto' : ''}`;
    const note = [s.help, s.change === 'reset' ? 'changes at the next reset' : '', s.learned ? 'a change drops the learned values' : '',
      compared.has(s.name) ? `in the file: ${compared.get(s.name)}` : ''].filter(Boolean).join('; ');
    return make('tr', { className: `${s.staged ? 'staged' : ''} ${compared.has(s.name) ? 'other' : ''}` }, make('td', { textContent: s.name }), make('td', {}, entry(s, sayOfSettings), said),
      ...[s.unit, range, pretty(s.default, s.unit), note].map(text => make('td', { textContent: text })));
  };
  $('settings').replaceChildren(...Object.entries(TITLES).flatMap(([group, title]) => {
    const rows = shown.filter(s => groupOf(s) === group).sort((a, b) => FIRST.indexOf(a.name) - FIRST.indexOf(b.name)), staged = rows.filter(s => s.staged).length;
    if (!rows.length) return [];
    const head = make('thead', { innerHTML: '<tr><th>setting<th>value<th>unit<th>range<th>default<th>meaning' });
    return make('details', { open: opened.has(group) || wanted || $('changed').checked || rows.some(s => compared.has(s.name)) },
      make('summary', { textContent: `${title}: ${rows.length}${staged ? `, ${staged} staged` : ''}`, onclick: () => opened.delete(group) || opened.add(group) }),
      make('div', { className: 'wide' }, make('table', {}, head, make('tbody', {}, ...rows.map(row)))));
  }));
  const fields = (names, to) => settings.filter(s => names.test(s.name)).map(s =>
    make('label', {}, s.help.split(/[;,:]/)[0], ' ', entry(s, to), ` ${s.unit}${s.staged ? ' (staged)' : ''}`));
  $('nameplate').replaceChildren(...fields(/^nameplate|^inverter.dc_link_v/, sayOfPlate));
  $('knobs').replaceChildren(...fields(/^speed.phase_margin_deg|^motor.inertia|^injection.bandwidth_hz|^current_plant$/, sayOfLoops));
}
$('filter').oninput = $('changed').onchange = showSettings;
$('to-file').onclick = async () => {
  try { download('settings.txt', `# ${hello.version}\n` + (await ask('backup')).filter(line => line !== 'ok').join('\n') + '\n'); }
  catch (error) { sayOfSettings(error.message, true); }
};
const linesOf = async file => (await file.text()).split(/\r?\n/).map(line => line.trim()).filter(line => line && !line.startsWith('#'));
$('from-file').onchange = async event => {
  const [file] = event.target.files, lines = await linesOf(file);
  event.target.value = '';
  for (const [n, line] of lines.entries()) {
    sayOfSettings(`${n + 1} of ${lines.length}`);
    try { await ask(line); }
    catch (error) { sayOfSettings(`${file.name}, line ${n + 1}: ${line}: ${error.message}; ${n} lines before it are set`, true); return loadSettings(); }
  }
  sayOfSettings(`${file.name}: ${lines.length} lines are in force; "Save in the drive" keeps them over a reset`);
  loadSettings();
};
/** Compares with a file of `backup` lines: settings that it does not name have the value of the image. */
$('compare').onchange = async event => {
  const [file] = event.target.files, named = new Map();
  for (const line of await linesOf(file)) {
    const [word, ...rest] = line.split(/\s+/);
    if (word === 'set') for (let i = 0; i + 1 < rest.length; i += 2) named.set(rest[i], rest[i + 1]);
  }
  event.target.value = '';
  const same = (a, b) => String(a) === String(b) || Math.abs(a - b) <= 1e-6 * Math.abs(a);
  compared = new Map(settings.filter(s => s.change !== 'board' && s.name !== 'wiring_checked').map(s => [s.name, named.get(s.name) ?? s.default, s.value])
    .filter(([, inFile, value]) => !same(value, inFile)).map(([name, inFile]) => [name, inFile]));
  sayOfSettings(compared.size ? `${compared.size} settings differ from ${file.name}; they are marked` : `${file.name} has the same settings`);
  showSettings();
};
$('get-learned').onclick = async () => {
  try { $('learned').textContent = (await ask('learned')).join('\n'); } catch (error) { $('learned').textContent = error.message; }
};

// --- loops ---
const sayOfLoops = (text, bad) => { $('l-said').textContent = text; $('l-said').className = bad ? 'error' : ''; };
/** The figures that the settings give, staged ones included; or why there are none. */
function showLoops(loops) {
  const cell = (value, unit) => make('td', { textContent: value == null ? '–' : `${+value.toPrecision(3)}${unit}` });
  $('loops').replaceChildren(...(loops.error ? [make('tr', {}, make('td', { colSpan: 5, className: 'error', textContent: loops.error }))] : loops.map(([name, crossover, margin, peak, gains]) =>
    make('tr', {}, make('th', { textContent: name }), cell(crossover, ' Hz'), cell(margin, '°'), cell(peak, ''), make('td', { textContent: gains })))));
}
// By mode: the signal that triggers, the one that is judged, what else is recorded.
const STEP = { torque: ['i_q_ref_a', 'i_q_a', 'i_d_a torque_nm'], speed: ['speed_rpm', 'speed_rpm', 'i_q_a i_q_ref_a'], position: ['turns', 'turns', 'speed_rpm i_q_a'] };
let stepping = null, stepPlots = [];
$('step').onsubmit = async event => {
  event.preventDefault();
  const mode = regulated(), [trigger, judged, others] = STEP[mode], from = asked[mode] || 0, by = +$('l-by').value, divider = Math.ceil(12 * $('l-for').value);
  try {
    await ask('trace off').catch(quiet);
    await ask(`trace 500 ${divider} ${[...new Set([judged, trigger])].join(' ')} ${others} on ${trigger} ${by > 0 ? 'above' : 'below'} ${+(from + 0.1 * by).toPrecision(5)}`);
    stepping = { judged, from, by };
    await tell(`${mode} ${from + by}`, sayOfLoops);
    sayOfLoops(`from ${from} to ${from + by}: recording`);
  } catch (error) { sayOfLoops(error.message, true); }
};
/** Shows the record of a step and its figures: the times are those of the value judged, less where it began, over the step. */
function showStep(lines) {
  const { judged, from, by } = stepping, names = [...lines[0].split(',').slice(1), `asked_${judged.match(/_([a-z]+)$/)?.[1] || 'turns'}`];
  const rows = lines.slice(1, -1).map(line => line.split(',').map(Number)), y = rows.map(row => row[names.indexOf(judged) + 1]);
  const begun = y.slice(0, 100).reduce((a, b) => a + b) / 100, share = y.map(value => (value - begun) / (from + by - begun));
  const at = level => rows[share.findIndex(value => value >= level)]?.[0], end = share.slice(-50).reduce((a, b) => a + b) / 50;
  stepPlots = buildPlots($('stepped'), names, 'step');
  rows.forEach(row => row.push(from + (row[0] < 0 ? 0 : by)));
  stepPlots.forEach(({ plot, indices }) => plot.setData([rows.map(row => row[0]), ...indices.map(i => rows.map(row => row[i + 1]))]));
  sayOfLoops(`10 to 90 % in ${pretty(at(0.9) - at(0.1), 's')}, overshoot ${Math.max(0, 100 * (Math.max(...share) - 1)).toFixed(1)} %, at the end ${(100 * end).toFixed(1)} % of the step`);
  stepping = null;
}

// --- trace ---
let tracePlots = [], traceText = '';
const sayOfTrace = (text, bad) => { $('t-said').textContent = text; $('t-said').className = bad ? 'error' : ''; };
/** Plots the lines of a trace; what there is to say of it. */
function plotTrace(lines) {
  const [head, ...rest] = lines.filter(line => line !== 'ok');
  if (!head?.startsWith('t_s')) throw Error(head || 'no records');
  const names = head.split(',').slice(1), rows = rest.map(line => line.split(',').map(Number));
  tracePlots = buildPlots($('traced'), names, 'trace');
  const column = i => rows.map(row => row[i]);
  tracePlots.forEach(({ plot, indices }) => plot.setData([column(0), ...indices.map(i => column(i + 1))]));
  traceText = [...header('trace', names, ''), head, ...rest].join('\n') + '\n';
  $('t-csv').disabled = false;
  return `${rows.length} records from ${rows[0]?.[0]} s to ${rows.at(-1)?.[0]} s; 0 is the first record, or the trigger`;
}
async function showTrace() {
  sayOfTrace('reading the trace');
  try {
    const lines = await ask('trace');
    stepping ? showStep(lines) : sayOfTrace(plotTrace(lines));
  } catch (error) { sayOfTrace(error.message, true); }
}
$('trace').onsubmit = async event => {
  event.preventDefault();
  stepping = null;
  const trigger = $('t-trigger').value;
  const on = trigger === 'fault' ? ' on fault' : trigger ? ` on ${$('t-signal').value} ${trigger} ${$('t-level').value}` : '';
  sayOfTrace(trigger ? 'waiting for the trigger' : 'recording');
  try {
    const lines = await ask(`trace ${$('t-records').value} ${$('t-divider').value} ${chosen().join(' ')}${on}`);
    if (!trigger) sayOfTrace(plotTrace(lines));
  } catch (error) { sayOfTrace(error.message, true); }
};
$('t-off').onclick = () => tell('trace off', sayOfTrace).catch(quiet);
$('t-csv').onclick = () => download('trace.csv', traceText);

// --- set-up --------------------------------------------------------------------------------------
const seconds = s => new Promise(resolve => setTimeout(resolve, 1000 * s));
async function tenth() {
  const amperes = +(settings.find(s => s.name === 'limits.current_a').effective / 10).toPrecision(3);
  await tell(`torque ${amperes}`, quiet);
  await seconds(3);
  const [status] = await ask('status'), [torque, speed] = ['torque', 'speed'].map(id => status.match(NUMBERS[id][0])?.[0]);
  await tell('stop', quiet);
  if (!status.startsWith('regulating')) throw Error(status.split(';')[0]);
  return `with ${amperes} A: ${torque}, ${speed}`;
}
const BOARD = { name: 'Check the board', about: 'Do the bench steps of the board with the power stage as the page "First power-up" says; the values that the drive reads stand below. "Confirm" notes that all were done: until then the drive does not start.',
  lines: ['board'], after: [['Confirm', 'confirm board']] };
const STEPS = [
  { name: 'Check the wiring', about: 'The drive starts once with a check of the phases and the current sensors, and stops again. The shaft may turn a little.',
    lines: ['set wiring_checked no', 'apply', 'start torque'], good: /^running: /, then: () => tell('stop', quiet).then(() => 'the wiring is as it should be') },
  { name: 'Commission', about: 'The drive measures the motor at rest, from its nameplate, in ten seconds; the shaft stays still. "Accept" puts the results in force and saves them.',
    lines: ['commission'], good: /^commissioning: ended; `accept`/, bad: /^commissioning: ended; the settings/, after: [['Accept', 'accept']] },
  { name: 'Learn', about: 'Lock the shaft. The drive learns how the saliency changes with the current, which takes about a minute. "Save" keeps it over a reset; "Learn again" at another rotor position adds to it.',
    lines: ['learn'], good: /^learned: /, bad: /^refused: /, after: [['Learn again', 'learn again'], ['Save', 'save']] },
  { name: 'Start with a tenth of the current', about: 'The drive regulates a tenth of its current limit for three seconds, then stops. A free shaft turns: forwards, phase a towards b towards c.',
    lines: ['start torque'], good: /^running: /, then: tenth },
  { name: 'Measure the inertia', about: 'Optional, for speed and position. Release the shaft: it turns, at most two turns to and fro.',
    lines: ['commission inertia'], good: /^commissioning: ended; `accept`/, bad: /^commissioning: ended; the settings/, after: [['Accept', 'accept']] },
];
const MEASURED = ['nameplate', 'sensors', 'wiring', 'levels', 'leakage', 'staircase', 'current-loop'];
function guide(step) {
  const bar = make('progress', { max: 1, value: 0, hidden: true }), verdict = make('strong'), lines = make('pre'), found = make('tbody');
  const folded = make('details', { hidden: true }, make('summary', { textContent: 'lines of the drive' }), lines);
  const table = make('table', { hidden: true }, make('thead', { innerHTML: '<tr><th>step<th>quantity<th>found<th>allowed' }), found);
  const show = (text, bad) => { verdict.textContent = text.replace(/`(\w)(\w*)`/g, (_, a, rest) => `"${a.toUpperCase()}${rest}"`); verdict.className = bad ? 'error' : ''; };
  const note = text => { folded.hidden = false; lines.textContent += `${text}\n`; lines.scrollTop = lines.scrollHeight; };
  const end = (text, bad) => { listeners = listeners.filter(known => known !== hear); bar.hidden = true; show(text, bad); };
  const fail = error => end(`not done: ${error.message}`, true);
  function hear(line) {
    const point = line.match(/^learning: point (\d+) of (\d+), (.*)/);
    if (point) { bar.max = +point[2]; bar.value = +point[1]; return show(point[0]); }
    note(line);
    const [, measured, text] = line.match(/^commissioning: ([a-z-]+): (.*)/) || [];
    if (MEASURED.includes(measured)) { bar.max = MEASURED.length; bar.value = MEASURED.indexOf(measured) + 1; }
    if (/^(sound|refused)/.test(text)) show(`${measured}: ${text}`);
    if (text) {
      const [, quantity, value, allowed] = text.match(/^(.*) (-?[\d.]+(?: \+-[\d.]+)?(?: [^\d\s(][^\s(]*)*) ?(?:\(allowed: (.*)\))?$/) || [, '', text, ''];
      table.hidden = false;
      found.append(make('tr', {}, ...[measured, quantity, value.replace('+-', '±'), allowed || ''].map(textContent => make('td', { textContent }))));
    }
    if (step.good.test(line)) { bar.hidden = true; (step.then ? step.then() : Promise.resolve(line)).then(text => listeners.includes(hear) && end(`done: ${text}`), fail); }
    else if (step.bad?.test(line) || /^(fault|stopped|off: the start)/.test(line)) end(`not done: ${line}`, true);
  }
  async function begin(all) {
    // It runs already.
    if (listeners.includes(hear)) return;
    if (step.good) listeners = listeners.concat(hear);
    lines.textContent = ''; found.replaceChildren(); table.hidden = true;
    bar.hidden = false; bar.removeAttribute('value'); show('running');
    try {
      for (const line of all) for (const answer of await tell(line, quiet)) note(all.length > 1 ? `${line}: ${answer}` : answer);
      if (!step.good) end(`done: ${lines.textContent.trim().split('\n').at(-2)}`);
    } catch (error) { fail(error); }
  }
  const button = (textContent, onclick, when) => { const made = make('button', { textContent, onclick }); made.dataset.when = when; return made; };
  return make('li', {}, make('h2', { textContent: step.name }), make('p', { textContent: step.about }),
    make('div', { className: 'row' }, button(step.name, () => begin(step.lines), 'off'),
      ...(step.after || []).map(([name, line]) => button(name, () => line.startsWith('learn') ? begin([line]) : tell(line, show).then(loadSettings, quiet), 'off')),
      bar, verdict), make('div', { className: 'wide' }, table), folded);
}
$('steps').prepend(guide(BOARD));
$('steps').append(...STEPS.map(guide));
$('steps').firstChild.append(make('p', { id: 'reading', className: 'hint' }));

const sayOfPassport = (text, bad) => { $('passport-said').textContent = text; $('passport-said').className = bad ? 'error' : ''; };
/** The lines of commissioning and learning, and the answers that `hil-sim passport` reads beside them. */
async function passportRecord() {
  const lines = $('log').textContent.split('\n').filter(line => line.startsWith('* '));
  for (const line of ['version', 'describe', 'learned']) lines.push(...await ask(line));
  // The simulated drive has no image of its own.
  if (!lines.some(line => line.includes(', image '))) lines.push(`${hello.version}, image of page ${hello.program}`);
  return lines.join('\n') + '\n';
}
$('passport').onclick = () => passportRecord().then(text => download('motor.log', text), error => sayOfPassport(error.message, true));

// --- a simulated motor ---
/** Lines for drive and motor, one after the other. `~off` switches off first, `~STATE` waits for a state. */
async function play(lines) {
  try {
    for (const line of lines.split('; ')) {
      if (line[0] !== '~') { await tell(line); continue; }
      if (line === '~off' && /^in fault/.test(present)) await tell('clear');
      else if (line === '~off' && !/^(off|learning)/.test(present)) await tell('stop');
      // The state is five times a second old. Learning takes its time.
      for (let n = 0; n < 50; n += /^learning/.test(present) ? 0 : 1) if (await seconds(0.25), present.startsWith(line.slice(1)) || /^in fault/.test(present)) break;
    }
  } catch { /* told already */ }
}
/** The motors of the page. Another one needs another drive, so the page opens anew. The guide has currents and speeds of the first one. */
function motorsChoice({ motors, dc_link_v }) {
  $('motor').replaceChildren(...motors.map(([value, title]) => make('option', { value, textContent: `${title} (${value})`, defaultSelected: value === (query.get('motor') || motors[0][0]) })));
  $('motor').onchange = () => { location.search = new URLSearchParams({ seed: query.get('seed') || 1, motor: $('motor').value }); };
  $('motor').parentElement.hidden = false;
  $('guide').hidden = $('motor').selectedIndex > 0;
  document.querySelector('[data-line="!dc"]').defaultValue = dc_link_v;
}
/** An address that brings the drive of a page into the present state: with its seed, the lines that have changed the motor, and the set-point. */
function address() {
  const mode = regulated(), word = mode === 'vf' ? 'speed' : mode;
  // A load acts on a drive that regulates: it would turn the shaft of one that is off.
  const lines = [...(mode ? [`start ${mode}`, mode === 'vf' ? '~turning' : '~regulating'] : []), ...altered.values(), ...(mode ? [`${word} ${asked[word] || 0}`] : [])];
  const state = new URLSearchParams({ seed: query.get('seed') || 1, motor: $('motor').value, ...(lines.length ? { play: lines.join('; ') } : {}) });
  return `${location.origin}${location.pathname}?${state}`;
}
$('share').onclick = () => {
  history.replaceState(null, '', address());
  navigator.clipboard?.writeText(location.href).then(() => say('the address is in the clipboard'), () => say('the address stands above the page'));
};
document.querySelectorAll('[data-play]').forEach(button => { button.onclick = () => play(button.dataset.play); });
document.querySelectorAll('[data-line]').forEach(field => { field.onchange = () => tell(`${field.dataset.line} ${field.value}`).catch(quiet); });
$('around').onsubmit = event => event.preventDefault();
document.querySelectorAll('.repair').forEach(button => { button.onclick = () => { $('around').reset(); document.querySelectorAll('[data-repair]').forEach(field => field.onchange()); }; });
const minutes = [...document.querySelectorAll('[data-step]')];
let minute = 0;
$('strip').append(...['ENABLE', 'START', 'STOP', 'REVERSE', 'RESET', 'PRESET1', 'PRESET2'].map(value =>
  make('label', {}, make('input', { type: 'checkbox', value, onchange: () =>
    tell(`!strip ${[...document.querySelectorAll('#strip :checked')].map(box => box.value).join(' ')}`).catch(quiet) }), ` ${value}`)));
function turn(by) {
  minute += by;
  minutes.forEach((step, n) => { step.hidden = n !== minute; });
  $('step-of').textContent = `${minute + 1} of ${minutes.length}`;
  [$('back').disabled, $('next').disabled] = [minute === 0, minute === minutes.length - 1];
}
$('back').onclick = () => turn(-1);
$('next').onclick = () => turn(1);
turn(0);

// --- console ---
const past = [];
let at = 0;
function log(text) {
  const box = $('log'), down = box.scrollTop + box.clientHeight >= box.scrollHeight - 20;
  box.textContent = (box.textContent + text + '\n').slice(-60000);
  if (down) box.scrollTop = box.scrollHeight;
}
$('console').onsubmit = event => {
  event.preventDefault();
  const line = $('line').value.trim();
  $('line').value = '';
  if (line) { at = past.push(line); tell(line, quiet).catch(quiet); }
};
$('line').onkeydown = event => {
  if (event.key !== 'ArrowUp' && event.key !== 'ArrowDown') return;
  at = Math.max(0, Math.min(past.length, at + (event.key === 'ArrowUp' ? -1 : 1)));
  $('line').value = past[at] || '';
};

view('view-live');
connect();
