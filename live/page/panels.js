// The views of settings, trace, set-up and console.

// --- views ---------------------------------------------------------------------------------------
const views = [...document.querySelectorAll('main > section')];
function view(id) {
  views.forEach(section => section.classList.toggle('shown', section.id === id));
  document.querySelectorAll('nav button').forEach(tab => tab.setAttribute('aria-selected', tab.dataset.view === id));
  dispatchEvent(new Event('resize'));
}
document.querySelector('nav').append(...views.map(section => {
  const tab = make('button', { textContent: section.dataset.name, onclick: () => view(section.id) });
  tab.dataset.view = section.id;
  tab.setAttribute('role', 'tab');
  return tab;
}));

// --- settings ------------------------------------------------------------------------------------
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
function showSettings() {
  const wanted = $('filter').value.toLowerCase();
  const rows = settings.filter(s => (s.name + s.help).toLowerCase().includes(wanted))
    .filter(s => !$('changed').checked || s.value !== s.default || s.staged || compared.has(s.name)).map(s => {
    const effective = s.value === 'auto' && s.effective != null ? ` = ${number7(s.effective)}` : '';
    const range = s.min == null ? s.words.join(', ') : `${number7(s.min)} to ${number7(s.max)}${s.auto ? ', or auto' : ''}`;
    const note = [s.help, s.change === 'reset' ? 'from the next reset on' : '', s.learned ? 'a change forgets what was learned' : '',
      compared.has(s.name) ? `in the file: ${compared.get(s.name)}` : ''].filter(Boolean).join('; ');
    return make('tr', { className: `${s.staged ? 'staged' : ''} ${compared.has(s.name) ? 'other' : ''}` }, make('td', { textContent: s.name }), make('td', {}, entry(s, sayOfSettings), effective),
      ...[s.unit, range, number7(s.default), note].map(text => make('td', { textContent: text })));
  });
  document.querySelector('#settings tbody').replaceChildren(...rows);
  $('nameplate').replaceChildren(...settings.filter(s => /^nameplate|^inverter.dc_link_v/.test(s.name)).map(s =>
    make('label', {}, s.help.split(/[;,]/)[0], ' ', entry(s, sayOfPlate), ` ${s.unit}${s.staged ? ' (staged)' : ''}`)));
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
/** Compares with a file of `backup` lines: what it does not name has the value of the image. */
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

// --- trace ---------------------------------------------------------------------------------------
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
  try { sayOfTrace(plotTrace(await ask('trace'))); } catch (error) { sayOfTrace(error.message, true); }
}
$('trace').onsubmit = async event => {
  event.preventDefault();
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
const STEPS = [
  { name: 'Check the wiring', about: 'The drive starts once with a check of the phases, the sensors and the encoder, and stops again. The shaft may turn a little.',
    lines: ['set wiring_checked no', 'apply', 'start torque'], good: /^running: /, then: ['stop'], verdict: 'the wiring is as it should be' },
  { name: 'Commission', about: 'The drive measures the motor at rest, from its nameplate, in ten seconds; the shaft stays still. "Accept" puts what was found in force and saves it.',
    lines: ['commission'], good: /^commissioning: ended; `accept`/, bad: /^commissioning: ended; the settings/, after: [['Accept', 'accept']] },
  { name: 'Learn', about: 'Lock the shaft. The drive learns how the angle follows from the carrier, about a minute. "Save" keeps it over a reset; "Learn again" at another rotor position adds to it.',
    lines: ['learn'], good: /^learned: /, bad: /^refused: /, after: [['Learn again', 'learn again'], ['Save', 'save']] },
  { name: 'Measure the inertia', about: 'Optional, for speed and position. Release the shaft: it turns, at most two turns to and fro.',
    lines: ['commission inertia'], good: /^commissioning: ended; `accept`/, bad: /^commissioning: ended; the settings/, after: [['Accept', 'accept']] },
];
const MEASURED = ['nameplate', 'sensors', 'wiring', 'levels', 'leakage', 'staircase', 'current-loop'];
$('steps').append(...STEPS.map(step => {
  const bar = make('progress', { max: 1, value: 0, hidden: true }), verdict = make('strong'), lines = make('pre', { hidden: true });
  const show = (text, bad) => { verdict.textContent = text; verdict.className = bad ? 'error' : ''; };
  const note = text => { lines.hidden = false; lines.textContent += `${text}\n`; lines.scrollTop = lines.scrollHeight; };
  const end = (text, bad) => { listeners = listeners.filter(known => known !== hear); bar.hidden = true; show(text, bad); };
  function hear(line) {
    const point = line.match(/^learning: point (\d+) of (\d+), (.*)/);
    if (point) { bar.max = +point[2]; bar.value = +point[1]; return show(point[0]); }
    note(line);
    const [, measured, found] = line.match(/^commissioning: ([a-z-]+): (sound|refused.*)/) || [];
    if (MEASURED.includes(measured)) { bar.max = MEASURED.length; bar.value = MEASURED.indexOf(measured) + 1; }
    if (found) show(`${measured}: ${found}`);
    if (step.good.test(line)) { end(`done: ${step.verdict || line}`); (step.then || []).forEach(next => tell(next, show).then(() => show(`done: ${step.verdict}`), quiet)); }
    else if (step.bad?.test(line) || /^(fault|stopped|off: the start)/.test(line)) end(`not done: ${line}`, true);
  }
  async function begin(all) {
    // It runs already.
    if (listeners.includes(hear)) return;
    listeners = listeners.concat(hear);
    lines.textContent = ''; bar.hidden = false; bar.removeAttribute('value'); show('running');
    try { for (const line of all) await tell(line, text => note(`${line}: ${text}`)); } catch (error) { end(`not done: ${error.message}`, true); }
  }
  return make('li', {}, make('h2', { textContent: step.name }), make('p', { textContent: step.about }),
    make('div', { className: 'row' }, make('button', { textContent: step.name, onclick: () => begin(step.lines) }),
      ...(step.after || []).map(([name, line]) => make('button', { textContent: name, onclick: () => line.startsWith('learn') ? begin([line]) : tell(line, show).then(loadSettings, quiet) })),
      bar, verdict), lines);
}));

// --- console -------------------------------------------------------------------------------------
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
