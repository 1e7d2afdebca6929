(() => {
const box = document.getElementById(ID), data = JSON.parse(box.querySelector('script').textContent);
const canvas = box.querySelector('canvas'), ink = canvas.getContext('2d');
const [play, slider, clock, speed] = ['button', 'input', 'output', 'select'].map(x => box.querySelector(x));
let turn = -0.9, tilt = 0.45, zoom = 1, now = 0, playing = false, before = 0, held = null;
const middle = data.low.map((x, i) => (x + data.high[i]) / 2);
const reach = Math.hypot(...data.low.map((x, i) => data.high[i] - x)) || 1;
function flat(p) {
  const [x, y, z] = p.map((v, i) => v - middle[i]), c = Math.cos(turn), s = Math.sin(turn);
  const a = c * x - s * y, b = s * x + c * y;
  const scale = 0.95 * zoom * Math.min(canvas.width, 1.6 * canvas.height) / reach;
  const up = z * Math.cos(tilt) + b * Math.sin(tilt);
  return [canvas.width / 2 + scale * a, canvas.height / 2 - scale * up];
}
function line(points, colour, width, dash) {
  ink.beginPath(); ink.setLineDash(dash || []); ink.strokeStyle = colour; ink.lineWidth = width;
  points.forEach((p, i) => { const [x, y] = flat(p); i ? ink.lineTo(x, y) : ink.moveTo(x, y); });
  ink.stroke(); ink.setLineDash([]);
}
function dot(p, colour, radius, full) {
  const [x, y] = flat(p); ink.beginPath(); ink.arc(x, y, radius, 0, 7);
  ink.fillStyle = ink.strokeStyle = colour; full ? ink.fill() : ink.stroke();
}
function draw() {
  ink.clearRect(0, 0, canvas.width, canvas.height);
  const [l, h] = [data.low, data.high];
  for (const z of [l[2], h[2]])
    line([[l[0], l[1], z], [h[0], l[1], z], [h[0], h[1], z], [l[0], h[1], z], [l[0], l[1], z]], '#bbb', 1);
  for (const x of [l[0], h[0]]) for (const y of [l[1], h[1]]) line([[x, y, l[2]], [x, y, h[2]]], '#ddd', 1);
  const n = Math.min(Math.round(now / data.step), data.samples - 1);
  for (const v of data.vehicles) {
    const trail = v.flown.slice(Math.max(0, n - Math.round(5 / data.step)), n + 1).filter(p => p);
    line(trail.map(p => p.slice(0, 3)), v.colour, 1);
    const p = v.flown[n], wanted = v.wanted[n];
    if (wanted) dot(wanted, v.colour, 6, false);
    if (wanted && p) line([p.slice(0, 3), wanted], v.colour, 1, [3, 3]);
    if (!p) continue;
    const tip = [p[0] + 0.15 * Math.cos(p[3]), p[1] + 0.15 * Math.sin(p[3]), p[2]];
    line([p.slice(0, 3), tip], v.colour, 3); line([p.slice(0, 3), [p[0], p[1], l[2]]], '#ccc', 1);
    dot(p.slice(0, 3), v.colour, 5, true);
    const [x, y] = flat(p.slice(0, 3)); ink.fillStyle = '#222'; ink.fillText(v.name, x + 8, y - 8);
  }
  const recent = data.events.filter(e => e.t <= now && e.t > now - 4).slice(-6);
  recent.forEach((e, i) => {
    ink.fillStyle = e.alarming ? '#b3261e' : '#444'; ink.fillText(e.text, 10, 20 + 16 * i);
  });
  slider.value = now; clock.textContent = now.toFixed(1) + ' s';
}
function tick(t) {
  if (playing) {
    now += (t - before) / 1000 * speed.value;
    if (now >= data.seconds) { now = data.seconds; playing = false; play.textContent = 'Play'; }
    draw();
  }
  before = t; requestAnimationFrame(tick);
}
play.onclick = () => {
  if (!playing && now >= data.seconds) now = 0;
  playing = !playing; play.textContent = playing ? 'Pause' : 'Play';
};
slider.oninput = () => { now = +slider.value; draw(); };
canvas.onpointerdown = e => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); };
canvas.onpointerup = () => { held = null; };
canvas.onpointermove = e => {
  if (!held) return;
  turn += (e.clientX - held[0]) / 150; tilt += (e.clientY - held[1]) / 150;
  tilt = Math.max(0, Math.min(1.57, tilt)); held = [e.clientX, e.clientY]; draw();
};
canvas.onwheel = e => { e.preventDefault(); zoom *= Math.exp(-e.deltaY / 800); draw(); };
ink.font = '13px system-ui'; draw(); requestAnimationFrame(tick);
})();
