'use strict';
// The connection, the head of the page, and the live view. panels.js has the other views.
const $ = id => document.getElementById(id), PERIOD_S = 1 / 6000;
const make = (tag, attributes = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), attributes);
  element.append(...children);
  return element;
};

// --- connection ---
const query = new URLSearchParams(location.search), token = query.get('token');
let socket, number = 0, hello = null, gone = 'connecting', answers = new Map(), listeners = [];

/** A socket to the program that serves this page. A page without its token has drive and motor in a worker, which says and hears the same. */
function dial() {
  if (token) return Object.assign(new WebSocket(`ws://${location.host}/ws?token=${token}`), { binaryType: 'arraybuffer' });
  const worker = new Worker(`worker.js${location.search}`);
  worker.onerror = event => lost(`drive and motor do not run here: ${event.message || 'worker.js or drive.wasm is missing'}`);
  return Object.assign(worker, { readyState: 1, send: text => worker.postMessage(text), close: () => { worker.terminate(); worker.onclose(); } });
}
/** Sends a line to the console; its lines, or an error with the text of the refusal. */
function ask(line) { return request({ ask: [++number, line] }); }
function request(message) {
  return new Promise((resolve, reject) => {
    if (!socket || socket.readyState !== 1) return reject(Error('not connected'));
    answers.set(number, { resolve, reject });
    socket.send(JSON.stringify(message));
  });
}
function stopDrive() {
  if (socket && socket.readyState === 1) socket.send('"stop"');
  say('stop');
}
function connect() {
  socket = dial();
  socket.onmessage = event => {
    if (event.data instanceof ArrayBuffer) return takeFrames(new DataView(event.data));
    for (const message of JSON.parse(event.data)) heard(message);
    // Tells the server that this page lives and shows its data: without it the drive is stopped.
    socket.send('"ack"');
  };
  socket.onclose = () => {
    lost(gone || 'the program that serves this page has ended, or the connection to it is lost: the drive is stopped');
    answers.forEach(answer => answer.reject(Error('the connection is lost')));
    answers.clear();
    if (!/another page/.test(gone)) setTimeout(connect, 1000);
  };
}
function heard(message) {
  if ('tick' in message) return tick(message);
  if ('status' in message) return showStatus(message.status);
  if ('line' in message) { log(message.line); announced(message.line); }
  if ('hello' in message) greet(message.hello);
  if ('gone' in message) lost(message.gone);
  if ('stopped' in message) { log(`# stopped: ${message.stopped}`); announced(`stopped: ${message.stopped}`); }
  if ('refused' in message) log(`# refused: ${message.refused}`);
  if (message.loops) showLoops(message.loops);
  const answer = answers.get(message.id);
  if (!answer) return;
  answers.delete(message.id);
  if (message.error) return answer.reject(Error(message.error));
  const last = message.lines.at(-1) || '';
  last.startsWith('error:') ? answer.reject(Error(last.slice(6).trim())) : answer.resolve(message.lines);
}
function greet(now) {
  const fresh = !hello || hello.version !== now.version;
  hello = now; gone = '';
  document.body.classList.toggle('is-simulated', /simulated/.test(now.version));
  $('who').textContent = `firmware ${now.version}; page ${now.program}`;
  const link = (textContent, path) => [' · ', make('a', { textContent, href: now.project + path })];
  $('links').replaceChildren(...link('project', ''), ...link('manual', '/blob/main/docs/README.md'), ...link('licence', '/blob/main/LICENSE-MIT'), ' (not public yet)');
  alarm('fit', now.misfit ? [now.misfit] : []);
  alarm('gone', []);
  if (fresh) signalsChoice();
  if (fresh && now.motors) motorsChoice(now);
  if (now.signals.length) restream();
  loadSettings();
  if (fresh && !token && query.has('play')) play(`~learning; ~off; ${query.get('play')}`);
}
function lost(why) {
  gone = why;
  state('not connected');
  alarm('gone', [why]);
  // Lines of the drive are lost meanwhile, so a step of the set-up that waits for one ends.
  announced(`stopped: ${why}`);
}
/** A line of the console: an announcement, `* TEXT`. */
function announced(said) {
  const line = said.replace(/^\* /, '');
  listeners.forEach(listener => listener(line));
  if (line.startsWith('fault ')) showFault();
  if (/^(off|stopped|running|homing): /.test(line)) say(line);
  if (line.startsWith('trace: ')) showTrace();
  if (line.startsWith('link: ') || line.startsWith('induction-drive ')) request({ ask: [++number, 'version'] }).then(restream);
}

const views = [...document.querySelectorAll('main > section')];

// --- head ---
// The last set-point of this page, by mode.
let alarms = {}, present = '', asked = {};
// Lines that have changed motor, load or sensors, by what they change.
const altered = new Map();
function alarm(name, lines) {
  alarms[name] = lines;
  const all = Object.values(alarms).filter(list => list.length);
  $('alarm').hidden = !all.length;
  $('alarm').replaceChildren(...all.map(([first, ...rest]) =>
    make('div', {}, first, rest.length ? make('ul', {}, ...rest.map(text => make('li', { textContent: text }))) : '')));
}
function state(text) {
  const changed = present !== text;
  present = text;
  $('state').textContent = text;
  $('state').className = `state ${/fault|not conn/.test(text) ? 'fault' : /^off/.test(text) ? '' : 'run'}`;
  if (changed) follow();
}
const NUMBERS = { torque: [/torque (-?[\d.]+) Nm/, 'Nm'], speed: [/speed (-?[\d.]+) rpm/, 'rpm'], current: [/i_q (-?[\d.]+)/, 'A'],
  link: [/dc link (-?[\d.]+) V/, 'V'], heat: [/heat sink (-?[\d.]+)/, '°C'], stator: [/stator (-?[\d.]+)/, '°C'] };
/** A number without the sign of a zero. */
const unsigned = text => text.replace(/^-(?=[0.]*$)/, '');
function showStatus(line) {
  const now = line.split(';')[0];
  heardStatus = performance.now();
  alarm('odd', /^[a-z]/.test(now) && /dc link/.test(line) ? [] :
    [`The page does not understand the drive's status, so torque and speed are missing: firmware and page do not fit each other. It says: ${line}`]);
  if (/^in fault/.test(now) && !alarms.fault?.length) showFault();
  if (!/^in fault/.test(now) && alarms.fault?.length) alarm('fault', []);
  state(now.replace(/ \(.*/, ''));
  for (const [id, [pattern, unit]] of Object.entries(NUMBERS)) {
    const found = line.match(pattern);
    $(id).textContent = found ? `${unsigned(found[1])} ${unit}` : '–';
  }
  $('limit').textContent = line.match(/limiting now, because: ([^;]*)/)?.[1] || '';
  $('limit').parentElement.hidden = !$('limit').textContent;
  $('reading').textContent = [/fault input trips/, /sensors .* A(?=, torque)/, /dc link [\d.]+ V/, /heat sink -?\d+ degC/].map(part => line.match(part)?.[0]).filter(Boolean).join(', ');
}
// State that a control needs, by its attribute data-when.
const WHEN = {
  off: [/^off/, 'the drive must be off'],
  rest: [/^(off|in fault)/, 'the drive must be off'],
  on: [/^[a-z]+ing\b(?<!connecting)/, 'the drive is off'],
  running: [/^(regulating|turning)/, 'the drive does not run'],
  regulating: [/^regulating/, 'the drive does not regulate'],
  speed: [/^regulating speed/, 'the drive does not regulate the speed'],
  position: [/^regulating position/, 'the drive does not regulate the position'],
  fault: [/^in fault/, 'there is no fault'],
};
/** Controls that would be refused are disabled, and the view says why. */
function follow() {
  const mode = regulated();
  if (mode && $('mode').value !== mode) { $('mode').value = mode; $('mode').onchange(); }
  for (const section of views) {
    const waiting = {};
    for (const control of section.querySelectorAll('[data-when]')) {
      const [pattern, reason] = WHEN[control.dataset.when], waits = !pattern.test(present);
      control.disabled = waits;
      control.title = waits ? `${reason}; it is: ${present}` : '';
      if (waits && control.offsetParent) (waiting[reason] ||= new Set()).add(control.dataset.name || control.textContent);
    }
    section.querySelector('.why').textContent = Object.entries(waiting).map(([reason, names]) => `${[...names].join(', ')}: ${reason}`).join('; ');
  }
}
/** The mode that the drive runs in, as of the console. */
const regulated = () => present.match(/^regulating (\w+)/)?.[1] || (/^turning/.test(present) ? 'vf' : '');
async function showFault() {
  try {
    const [head, ...rest] = await ask('faults');
    if (head.startsWith('latched')) alarm('fault', [head.split('; last run')[0].replace('latched: f', 'F'), ...rest.filter(line => line !== 'ok'), 'Then: Clear fault.']);
  } catch (error) { log(`# ${error.message}`); }
}
function say(text, bad) { $('said').textContent = text; $('said').className = bad ? 'error' : ''; }
async function tell(line, to = say) {
  log(`> ${line}`);
  try {
    const lines = await ask(line), [word, value] = line.split(' ');
    if (/^(start|torque|speed|position)$/.test(word)) asked = { [value && word === 'start' ? value : word]: +value || 0 };
    if (/^(torque|speed|position)$/.test(word)) $('reference').value = value;
    for (const field of document.querySelectorAll('[data-line]')) if (line.startsWith(`${field.dataset.line} `)) field.value = line.slice(field.dataset.line.length + 1);
    // A turned flux is an event, not a state.
    if (line[0] === '!' && word !== '!turn') altered.set(word === '!sensor' ? word + value : word, line);
    to(lines.join(' ')); log(lines.join('\n'));
    return lines;
  }
  catch (error) { to(error.message, true); log(`error: ${error.message}`); throw error; }
}
const quiet = () => {};

// --- frames ---
// Legible on white and on black.
const COLOURS = ['#3b82f6', '#ef4444', '#22a559', '#d97706', '#a855f7', '#0891b2', '#db2777', '#85888c'];
const SYMBOLS = { a: 'A', v: 'V', hz: 'Hz', deg: '°', nm: 'Nm', c: '°C' };
const WORDS = { state: ['off', 'starting', 'running', 'stopping'],
  limit: ['none', 'voltage', 'heat sink', 'motor', 'inverter', 'dc link high', 'brake resistor', 'dc link low', 'ride-through', 'dc current or power'] };
let streamed = [], times = [], columns = [], paused = false, recorded = null, base = null, previous = 0, plots = [], shown = 0, phi = null;
/** The streamed signals, and the speed that was asked for beside the present one. */
const plotted = () => streamed.concat(streamed.includes('speed_rpm') ? 'asked_rpm' : []);
/** Keeps frames of ten little-endian words: period, sequence number, eight values. */
function takeFrames(view) {
  for (let at = 0; at + 40 <= view.byteLength; at += 40) {
    const period = view.getUint32(at, true);
    base ??= previous = period;
    // The drive was reset, and counts its periods anew.
    if ((period - previous | 0) < 0) { base = period; times = []; columns = columns.map(() => []); }
    previous = period;
    const time = ((period - base) >>> 0) * PERIOD_S;
    const values = streamed.map((_, i) => view.getFloat32(at + 8 + 4 * i, true));
    times.push(time);
    columns.forEach((column, i) => column.push(i < values.length ? values[i] : regulated() === 'speed' ? asked.speed : null));
    if (streamed.includes('phi_deg')) phi = values[streamed.indexOf('phi_deg')] / 360;
    recorded?.rows.push(`${time.toFixed(6)},${view.getUint16(at + 4, true)},${values.map(value => +value.toPrecision(7)).join(',')}`);
  }
  const keep = 62 * +$('rate').value;
  if (times.length > 2 * keep) { times.splice(0, times.length - keep); columns.forEach(column => column.splice(0, column.length - keep)); }
}
let counted = 0, flowed = 0, heardStatus = 0;
/** Nothing came for some seconds, and no answer is awaited: the stream has ended, or the drive is gone. */
function watch(count) {
  const now = performance.now();
  if (count !== counted || answers.size || gone) [counted, flowed, heardStatus] = [count, now, answers.size || gone ? now : heardStatus];
  if (gone) return;
  if (now - heardStatus > 3000) state('no answer');
  if (streamed.length && now - flowed > 1500) { flowed = now; stream(streamed).catch(quiet); }
}
const stream = names => ask(`stream ${names.join(' ')} ${Math.round(+$('rate').value) || 200}`);
function tick({ tick: [count, missing, damaged, skipped], flux }) {
  watch(count);
  $('count').textContent = streamed.length ? `${count} frames, ${missing} dropped${damaged ? `, ${damaged} damaged` : ''}${skipped ? `, ${skipped} skipped by the page` : ''}` : '';
  if (flux) drawFlux(flux[0], flux[1], flux[2]); else if (phi !== null && !truth) drawFlux(phi);
  if (!paused && times.at(-1) !== shown) requestAnimationFrame(draw);
}
/** Draws the newest part, all samples of it: uPlot draws the least and the largest of those at one pixel. */
function draw() {
  if (paused || !times.length) return;
  if (!shown) performance.mark('first picture');
  shown = times.at(-1);
  const begin = shown - +$('window').value;
  let from = times.length - 1;
  while (from > 0 && times[from - 1] >= begin) from--;
  const newest = times.slice(from);
  for (const { plot, indices } of plots) {
    plot.setData([newest, ...indices.map(i => columns[i].slice(from))]);
    // After the plot's own update, which shows the values at the cursor.
    if (plot.cursor.left < 0) queueMicrotask(() => plot.setLegend({ idx: newest.length - 1 }));
  }
}
const unit = name => (u => SYMBOLS[u] || u)(name.match(/_([a-z]+)$/)?.[1] || '');
const QUANTITIES = { phi: 'flux angle', flux: 'flux frequency', speed: 'speed', asked: 'set-point', i_d: 'd-axis current', i_q: 'q-axis current', v_d: 'd-axis voltage', v_q: 'q-axis voltage',
  delta_i: 'current difference of the demodulation', dc_link: 'dc link', i_a: 'phase current a', i_b: 'phase current b', i_c: 'phase current c', heat_sink: 'heat sink', limit: 'limited by', turns: 'position' };
/** A signal in words; without its unit, which stands at the axis. */
const titled = name => {
  const [, stem, ref] = name.match(/^(.*?)(_ref)?(?:_(?:a|v|hz|deg|nm|c|rpm|turns))?$/);
  return (QUANTITIES[stem] || stem) + (ref ? ', reference' : '');
};
const inWords = (name, v) => v == null || Number.isNaN(v) ? '–' : !(name in WORDS) ? v.toPrecision(4) : v >= 100 ? `fault ${v - 100}` : WORDS[name][v];
/** One plot a unit; they share the time axis below the last one, and the time at the cursor. */
function buildPlots(into, names, group) {
  into.replaceChildren();
  const units = [...new Set(names.map(name => unit(name) || name))], colour = name => () => getComputedStyle(document.documentElement).getPropertyValue(name);
  return units.map((u, n) => {
    const indices = names.flatMap((name, i) => (unit(name) || name) === u ? [i] : []), last = n === units.length - 1;
    const line = colour('--line'), axis = { stroke: colour('--soft'), grid: { stroke: line, width: 1 }, ticks: { stroke: line } };
    const time = last ? { label: 's', labelSize: 16, size: 34 } : { size: 2, values: (_, splits) => splits.map(() => ''), ticks: { show: false } };
    const plot = new uPlot({
      width: Math.max(240, into.clientWidth), height: (last ? 155 : 110),
      cursor: { sync: { key: group }, drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [{ ...axis, ...time }, { ...axis, label: u, labelSize: 18, size: 60 }],
      series: [{ label: 't', value: (_, v) => v == null ? '–' : `${v.toFixed(4)} s` }, ...indices.map(i => ({
        label: titled(names[i]), stroke: COLOURS[i % 8], width: 1.5, dash: /_ref|asked/.test(names[i]) ? [6, 4] : undefined, value: (_, v) => inWords(names[i], v) }))],
    }, [[], ...indices.map(() => [])], into);
    return { plot, indices };
  });
}
function chosen() { return [...document.querySelectorAll('#signals input:checked')].map(box => box.value); }
/** Currents first, then speed and torque; the angle, a sawtooth, last. */
const ORDER = ['a', 'rpm', 'nm', 'v', 'c', 'hz', '', 'deg'];
function signalsChoice() {
  const usual = ['i_q_a', 'i_q_ref_a', 'i_d_a', 'speed_rpm', 'torque_nm', 'phi_deg'], names = hello.signals.toSorted((a, b) => ORDER.indexOf(a.unit) - ORDER.indexOf(b.unit)).map(({ signal }) => signal);
  let kept; try { kept = JSON.parse(localStorage.getItem('signals')).filter(name => names.includes(name)); } catch { kept = []; }
  $('signals').replaceChildren(...names.map(signal => make('label', {},
    make('input', { type: 'checkbox', value: signal, checked: (kept.length ? kept : usual).includes(signal), onchange: restream }), ` ${titled(signal)}`)));
  $('t-signal').replaceChildren(...names.map(signal => make('option', { textContent: titled(signal), value: signal })));
}
async function restream() {
  const names = chosen();
  if (!names.length || names.length > 8) return say(names.length ? 'at most eight signals' : 'choose a signal', true);
  localStorage.setItem('signals', JSON.stringify(names));
  endRecord();
  try {
    await stream(names);
    [streamed, times, base] = [names, [], null];
    columns = plotted().map(() => []);
    plots = buildPlots($('curves'), plotted(), 'live');
  } catch (error) { say(error.message, true); }
}
function pause() {
  paused = !paused;
  $('pause').setAttribute('aria-pressed', paused);
}
const header = (what, names, extra) => [`# induction-drive ${what}, schema 1`, `# firmware ${hello.version}`, `# page ${hello.program}`, `# begun ${new Date().toISOString()}`,
  `# units s,${extra}${names.map(name => unit(name) || '1').join(',')}`];
function download(name, text) {
  const link = make('a', { href: URL.createObjectURL(new Blob([text], { type: 'text/csv' })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
function endRecord() {
  if (!recorded) return;
  download('record.csv', [...recorded.head, `t_s,sequence,${recorded.names.join(',')}`, ...recorded.rows].join('\n') + '\n');
  recorded = null;
  $('record').setAttribute('aria-pressed', false);
}

// --- flux ---
let truth = false;
/** Draws the drive's angle and the motor's, turns, and the motor's flux, Wb, where they are known. */
function drawFlux(angle, motor, psi) {
  truth ||= motor !== undefined;
  const canvas = $('flux'), pen = canvas.getContext('2d'), style = getComputedStyle(document.documentElement);
  const arrow = (turns, length, colour, width) => {
    const x = 150 + length * Math.cos(turns * 2 * Math.PI), y = 150 - length * Math.sin(turns * 2 * Math.PI);
    pen.strokeStyle = pen.fillStyle = colour; pen.lineWidth = width;
    pen.beginPath(); pen.moveTo(150, 150); pen.lineTo(x, y); pen.stroke();
    pen.beginPath(); pen.arc(x, y, width + 2, 0, 7); pen.fill();
  };
  pen.clearRect(0, 0, 300, 300);
  pen.strokeStyle = style.getPropertyValue('--line'); pen.lineWidth = 1;
  for (const r of [60, 120]) { pen.beginPath(); pen.arc(150, 150, r, 0, 7); pen.stroke(); }
  pen.beginPath(); pen.moveTo(10, 150); pen.lineTo(290, 150); pen.moveTo(150, 10); pen.lineTo(150, 290); pen.stroke();
  const on = !/^(off|not|in fault)/.test(present);
  if (psi > 0.02) arrow(motor, Math.min(140, 120 * psi / (drawFlux.most = Math.max(drawFlux.most || 0.1, psi))), style.getPropertyValue('--good'), 6);
  if (on) arrow(angle, 138, style.getPropertyValue('--blue'), 2);
  const error = ((angle - motor + 1.5) % 1 - 0.5) * 360;
  $('flux-text').textContent = motor === undefined ? 'rotor flux: the estimate of the drive'
    : `rotor flux: estimate (thin), motor (thick) ${psi.toFixed(2)} Wb${on && psi > 0.02 ? `, apart ${unsigned(error.toFixed(1))}°` : ''}`;
}

// --- controls ---
const WHAT = { torque: 'current, A peak', speed: 'speed, rpm', position: 'position, turns', vf: 'speed, rpm' };
($('mode').onchange = () => {
  const mode = $('mode').value;
  $('what').textContent = WHAT[mode];
  document.querySelectorAll('[data-mode]').forEach(part => { part.hidden = part.dataset.mode !== mode; });
  follow();
})();
$('stop').onclick = stopDrive;
$('start').onclick = () => tell(`start ${$('mode').value}`).catch(quiet);
$('run').onsubmit = event => { event.preventDefault(); tell(`${$('mode').value.replace('vf', 'speed')} ${$('reference').value}`).catch(quiet); };
$('home').onclick = () => tell(`home ${$('h-rpm').value} ${$('h-a').value} ${$('h-turns').value}`).catch(quiet);
/** The drive ends a jog that is not repeated within half a second. */
document.querySelectorAll('[data-jog]').forEach(button => {
  let repeat;
  const end = () => { if (repeat) tell('speed 0').catch(quiet); repeat = clearInterval(repeat); };
  const jog = () => ask(`jog ${button.dataset.jog * Math.abs($('reference').value)}`).catch(error => { say(error.message, true); repeat = clearInterval(repeat); });
  button.onpointerdown = () => { clearInterval(repeat); repeat = setInterval(jog, 200); jog(); };
  button.onpointerup = button.onpointerleave = button.onpointercancel = end;
});
$('pause').onclick = pause;
$('rate').onchange = restream;
$('record').onclick = () => {
  if (recorded) return endRecord();
  recorded = { head: header('record', streamed, '1,'), names: streamed, rows: [] };
  $('record').setAttribute('aria-pressed', true);
};
document.querySelectorAll('[data-ask]').forEach(button => {
  button.type = 'button';
  button.onclick = () => {
    const to = { 'view-settings': sayOfSettings, 'view-loops': sayOfLoops }[button.closest('section').id];
    tell(button.dataset.ask, to || say).then(() => to && loadSettings(), quiet);
  };
});
addEventListener('keydown', event => {
  if (event.key === 'Escape') { event.preventDefault(); stopDrive(); }
  else if (event.key === 'p' && !event.ctrlKey && !event.metaKey && !/INPUT|SELECT|TEXTAREA/.test(event.target.tagName)) pause();
}, true);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => [...plots, ...tracePlots, ...stepPlots].forEach(({ plot }) => plot.redraw()));
addEventListener('resize', () => document.querySelectorAll('.curves').forEach(into =>
  [...plots, ...tracePlots, ...stepPlots].forEach(({ plot }) => into.contains(plot.root) && into.clientWidth && plot.setSize({ width: Math.max(240, into.clientWidth), height: plot.height }))));
