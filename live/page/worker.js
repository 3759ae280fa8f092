'use strict';
// The firmware's drive and console and a simulated motor, as WebAssembly. To the page it behaves like `cargo live`, message for message.
const TICK_MS = 40;
let wasm, last, queue = [];
const bytes = (place, length) => new Uint8Array(wasm.memory.buffer, place, length);

function write(line) {
  const text = new TextEncoder().encode(line);
  bytes(wasm.line(text.length), text.length).set(text);
}
/** Sends the messages of the drive. */
function told() { postMessage(new TextDecoder().decode(bytes(wasm.place(0), wasm.length(0)))); }

/** A message of the page. */
function take(said) {
  const message = JSON.parse(said);
  if (message === 'stop') wasm.stop();
  if (!message.ask) return;
  write(message.ask[1]);
  wasm.ask(message.ask[0]);
}
onmessage = ({ data }) => wasm ? take(data) : queue.push(data);

/** Time passes as by the clock; faster while the drive learns. Time during which the page slept is skipped. */
function tick() {
  const now = performance.now();
  let hurries = wasm.advance(Math.round(Math.min(now - last, 5 * TICK_MS)));
  while (hurries && performance.now() - now < TICK_MS) hurries = wasm.advance(100);
  last = now;
  wasm.take();
  told();
  const frames = bytes(wasm.place(1), wasm.length(1)).slice().buffer;
  if (frames.byteLength) postMessage(frames, [frames]);
  setTimeout(tick, hurries ? 0 : TICK_MS);
}

(async () => {
  const { instance } = await WebAssembly.instantiate(await (await fetch('drive.wasm')).arrayBuffer(), {});
  wasm = instance.exports;
  const query = new URLSearchParams(location.search);
  write(query.get('motor') || 'dissertation');
  if (!wasm.init(+query.get('seed') || 1)) return told();
  last = performance.now();
  queue.forEach(take);
  tick();
})();
