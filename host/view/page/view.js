/* The page: messages from the program (host/view/message.h), panels, keyboard and mouse (host/view/command.h). */
'use strict';

(function () {
  const $ = (id) => document.getElementById(id);
  const KEY_SPEED_M_S = 0.06, KEY_TAP_M = 0.002;

  let stage = null, hello = null, frame = null, socket = null, retry_ms = 500;
  const trace = new Trace($('trace'));
  const seen = {frames: 0, first_s: 0, last_s: 0, max_mm: 0, peak_N: 0, history: []};
  const HISTORY = 20000; // points of the force kept for readers of window.trocar
  let target = null; // of the hand, trocar's frame, while this page moves it
  let unsent = false, peaks = [], rate = {wall: 0, time: 0};
  const held = new Set();

  try {
    stage = new Stage($('canvas'));
  } catch (error) {
    $('no-webgl').hidden = false;
    $('legend').hidden = true;
  }

  /* ---- messages ---- */

  function decode(buffer) {
    const view = new DataView(buffer), kind = view.getUint32(0, true), bytes = view.getUint32(4, true);
    const message = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, bytes)));
    let at = 8 + bytes;
    if (kind === 1) {
      const n = message.vertices, t = message.triangles;
      message.rest = new Float32Array(buffer, at, 3 * n);
      message.index = new Uint16Array(buffer, at += 12 * n, 3 * t);
      message.fixedFlags = new Uint8Array(buffer, at += 6 * t, n);
    } else if (kind === 2) {
      const packed = new Int16Array(buffer, at);
      message.u = new Float32Array(packed.length);
      for (let i = 0; i < packed.length; i++) message.u[i] = packed[i] * message.scale_m;
    }
    return {kind, message};
  }

  function connect() {
    socket = new WebSocket('ws://' + location.host + '/', 'trocar-view-1');
    socket.binaryType = 'arraybuffer';
    socket.onmessage = (event) => {
      const {kind, message} = decode(event.data);
      if (kind === 1) greet(message);
      else if (kind === 2 && hello) receive(message);
    };
    socket.onclose = () => {
      badge('OFFLINE');
      notice('The run has ended, or the connection was lost. Start it again with trocar view; this page connects by itself.', 'info', false);
      target = null;
      setTimeout(connect, retry_ms);
      retry_ms = Math.min(8000, retry_ms * 2);
    };
  }

  function greet(message) {
    hello = message;
    retry_ms = 500;
    trace.clear();
    target = null;
    $('scene').textContent = [hello.scene, hello.vertices + ' surface vertices', hello.triangles + ' triangles'].filter(Boolean).join(' \u00b7 ');
    document.title = (hello.scene ? hello.scene + ' \u2013 ' : '') + 'Trocar';
    buildHealth();
    if (stage) {
      stage.build(hello);
      setRange(0.005);
      setArrow(1);
    }
  }

  function receive(message) {
    frame = message;
    const newton = Math.hypot(...frame.force_N), max_mm = 1000 * (frame.max_m || 0);
    if (!seen.frames) seen.first_s = frame.time_s;
    seen.frames++;
    seen.last_s = frame.time_s;
    seen.max_mm = Math.max(seen.max_mm, max_mm);
    seen.peak_N = Math.max(seen.peak_N, newton);
    for (const [t, N] of frame.trace) seen.history.push({time_s: t, force_N: N});
    if (seen.history.length > HISTORY) seen.history.splice(0, seen.history.length - HISTORY);
    trace.add(frame.trace);

    peaks.push([frame.time_s, max_mm / 1000, newton]);
    while (peaks.length && (peaks[0][0] < frame.time_s - 8 || peaks[0][0] > frame.time_s)) peaks.shift();
    if (stage) {
      setRange(Math.max(0.005, ...peaks.map((p) => p[1])));
      setArrow(Math.max(0.1, ...peaks.map((p) => p[2])));
      stage.update(frame);
    }
    move();
  }

  function send(object) {
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(object));
  }

  /* ---- panels ---- */

  function badge(state) {
    if ($('state').textContent === state) return;
    $('state').textContent = state;
    $('state').className = 'badge ' + state;
  }

  function notice(text, kind, acknowledge) {
    $('notice').hidden = !text;
    $('notice').className = 'notice ' + kind;
    if ($('notice-text').textContent !== text) $('notice-text').textContent = text;
    $('acknowledge').hidden = !acknowledge;
  }

  function showState() {
    const silent = frame.silent_s > 1.5;
    badge(silent ? 'SILENT' : frame.state);
    if (silent) notice('Nothing was heard from the controller for ' + frame.silent_s.toFixed(1) + ' s: check its power and the bus.', '', false);
    else if (frame.state === 'SAFE') notice('Torque is off: ' + (frame.reason ? frame.meaning + ' (' + frame.reason + '). Then ' + frame.remedy + '.' : 'stopped on request.'), '', true);
    else if (frame.state === 'READY') notice('The controller is ready; torque is off until it is acknowledged.', 'info', true);
    else if (frame.field_error) notice('The displacement cannot be shown: ' + frame.field_error + '.', '', false);
    else notice('', '', false);
    $('stop').disabled = frame.state !== 'RUN';
  }

  let cells = [], units = [];
  function buildHealth() {
    /* a value's unit is the last part of its name */
    units = hello.health_names.map((name) => (/_100uJ$/.test(name) ? 0.1 : 1));
    const names = hello.health_names.map((name) => name.replace(/_100uJ$/, ' [mJ]')).concat(['Frames dropped', 'Messages refused']);
    const body = $('health').tBodies[0], rows = Math.ceil(names.length / 2);
    body.textContent = '';
    cells = [];
    for (let r = 0; r < rows; r++) body.insertRow();
    names.forEach((name, i) => {
      const row = body.rows[i % rows];
      row.insertCell().textContent = name.replace(/_/g, ' ').replace(/^./, (c) => c.toUpperCase());
      const cell = row.insertCell();
      cell.className = 'n';
      cells.push(cell);
    });
  }

  /* Names of what is information rather than a loss: not emphasised when it is above zero. */
  const PLAIN = /^tick|^energy|^Frames/;
  function showHealth() {
    const names = hello.health_names.concat(['Frames', 'Messages']);
    frame.health.concat([frame.dropped, frame.malformed]).forEach((value, i) => {
      const text = units[i] < 1 ? (value * units[i]).toFixed(1) : String(value);
      if (cells[i].textContent !== text) cells[i].textContent = text;
      cells[i].classList.toggle('count', value > 0 && !PLAIN.test(names[i]));
    });
  }

  function setRange(max_m) {
    const top_mm = [5, 10, 15, 20, 30, 40, 50, 75, 100, 150, 200, 500].find((r) => r >= 999 * max_m) || 1000;
    stage.range_m = top_mm / 1000;
    if ($('legend-ticks').dataset.top === String(top_mm)) return;
    $('legend-ticks').dataset.top = top_mm;
    $('legend-ticks').textContent = '';
    for (let k = 0; k <= 5; k++) {
      const tick = document.createElement('span');
      tick.style.top = 100 - 20 * k + '%';
      tick.textContent = Number((top_mm * k / 5).toPrecision(3)) + (k === 5 ? ' mm' : '');
      $('legend-ticks').append(tick);
    }
  }

  function drawBar() {
    const pen = $('legend-bar').getContext('2d');
    for (let y = 0; y < 150; y++) {
      pen.fillStyle = 'rgb(' + scaleColour(1 - y / 149).map(Math.round).join(',') + ')';
      pen.fillRect(0, y, 14, 1);
    }
  }

  function setArrow(max_N) {
    const {top} = Trace.scale(max_N);
    stage.metresPerNewton = 0.55 * stage.sphere.radius / top;
    const text = 'force, ' + Math.round(1000 * stage.metresPerNewton) + ' mm per N';
    if ($('arrow-scale').textContent !== text) $('arrow-scale').textContent = text;
  }

  function showNumbers() {
    $('clock').textContent = frame.time_s.toFixed(2) + ' s';
    $('force').textContent = Math.hypot(...frame.force_N).toFixed(2);
    $('displacement').textContent = (1000 * (frame.max_m || 0)).toFixed(1);
    $('driven').hidden = !frame.driven;
    /* over some seconds, because the browser itself holds messages up for parts of one */
    const now = performance.now();
    if (now - rate.wall > 5000) {
      const share = 1000 * (frame.time_s - rate.time) / (now - rate.wall);
      if (rate.wall && share > 0) $('rate').textContent = Math.abs(share - 1) < 0.1 ? 'real time' : Math.round(100 * share) + ' % of real time';
      rate = {wall: now, time: frame.time_s};
    }
  }

  function placeLabel() {
    const at = stage && frame ? stage.arrowOnScreen() : null, label = $('force-label');
    label.hidden = !at;
    if (!at) return;
    label.textContent = Math.hypot(...frame.force_N).toFixed(2) + ' N';
    label.style.transform = 'translate(' + Math.round(at.x + 18) + 'px,' + Math.round(at.y - 12) + 'px)';
  }

  /* ---- the hand ---- */

  const KEYS = {
    ArrowLeft: [-1, 0, 0], KeyA: [-1, 0, 0], ArrowRight: [1, 0, 0], KeyD: [1, 0, 0],
    ArrowUp: [0, 1, 0], KeyW: [0, 1, 0], ArrowDown: [0, -1, 0], KeyS: [0, -1, 0],
    PageDown: [0, 0, 1], KeyE: [0, 0, 1], PageUp: [0, 0, -1], KeyQ: [0, 0, -1],
  };

  /* Right and up as seen on the screen, inwards along the instrument; metres. */
  function push(right, up, inwards) {
    if (!frame) return;
    if (!target) target = frame.hand_m.slice();
    const [x, y] = stage ? stage.across(right, up) : [right, up], length = Math.hypot(...target) || 1;
    target = target.map((v, i) => v + [x, y, 0][i] + inwards * v / length);
    const low = 0.9 * hello.joint_min[2], high = 1.1 * hello.joint_max[2], reach = Math.hypot(...target) || 1;
    const scale = Math.min(high, Math.max(low, reach)) / reach;
    target = target.map((v) => v * scale);
    unsent = true;
  }

  function release() {
    target = null;
    unsent = false;
    send({hand: null});
  }

  /* Keys that are held move the hand by the run's time, once per frame. */
  let moved_s = 0;
  function move() {
    const step = KEY_SPEED_M_S * Math.min(0.1, Math.max(0, frame.time_s - moved_s));
    moved_s = frame.time_s;
    for (const code of held) push(...KEYS[code].map((v) => v * step));
    if (unsent && target) send({hand: target});
    unsent = false;
  }

  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.code === 'Space' && event.target.tagName !== 'BUTTON' && event.target.tagName !== 'INPUT') {
      event.preventDefault();
      release();
    }
    if (!KEYS[event.code]) return;
    event.preventDefault();
    if (!event.repeat) {
      push(...KEYS[event.code].map((v) => v * KEY_TAP_M));
      held.add(event.code);
    }
  });
  window.addEventListener('keyup', (event) => held.delete(event.code));
  window.addEventListener('blur', () => held.clear());

  /* Shift with mouse or wheel moves the hand; the listeners run before the orbit's, which then sees nothing of it. */
  let drag = null;
  const canvas = $('canvas');
  canvas.parentElement.addEventListener('mousedown', (event) => {
    if (!event.shiftKey || event.button !== 0 || !stage || !frame) return;
    event.preventDefault();
    event.stopPropagation();
    drag = [event.clientX, event.clientY];
  }, true);
  window.addEventListener('mousemove', (event) => {
    if (!drag) return;
    const size = stage.metresPerPixel();
    push((event.clientX - drag[0]) * size, (drag[1] - event.clientY) * size, 0);
    drag = [event.clientX, event.clientY];
  });
  window.addEventListener('mouseup', () => { drag = null; });
  canvas.parentElement.addEventListener('wheel', (event) => {
    if (!event.shiftKey) return;
    event.preventDefault();
    event.stopPropagation();
    push(0, 0, Math.sign(event.deltaY || event.deltaX) * 0.003);
  }, {capture: true, passive: false});

  $('acknowledge').addEventListener('click', () => send({do: 'acknowledge'}));
  $('stop').addEventListener('click', () => send({do: 'stop'}));
  $('home').addEventListener('click', () => stage && stage.home());
  $('edges').addEventListener('change', () => stage && stage.setEdges($('edges').checked));

  /* ---- one turn per picture ---- */

  let shown = 0;
  function turn() {
    requestAnimationFrame(turn);
    if (frame && frame.frame !== shown) {
      shown = frame.frame;
      showState();
      showHealth();
      showNumbers();
      trace.draw(frame.time_s);
    }
    if (stage && stage.render()) placeLabel();
  }

  window.addEventListener('resize', () => {
    if (stage) stage.resize();
    trace.draw(frame ? frame.time_s : 0);
  });
  if (stage && window.ResizeObserver) new ResizeObserver(() => stage.resize()).observe(canvas);

  /* Read-only state for tests and scripts. */
  Object.defineProperty(window, 'trocar', {
    value: Object.freeze({
      get connected() { return Boolean(socket && socket.readyState === WebSocket.OPEN); },
      get webgl() { return Boolean(stage); },
      get frames() { return seen.frames; },
      get first_s() { return seen.first_s; },
      get time_s() { return seen.last_s; },
      get displacement_mm() { return frame ? 1000 * frame.max_m : 0; },
      get largest_displacement_mm() { return seen.max_mm; },
      get force_N() { return frame ? Math.hypot(...frame.force_N) : 0; },
      get peak_force_N() { return seen.peak_N; },
      get force_history() { return seen.history.map((p) => ({...p})); },
      get tip_m() { return frame ? frame.tip_m.slice() : null; },
      get hand_m() { return frame ? frame.hand_m.slice() : null; },
      get driven() { return Boolean(frame && frame.driven); },
      get contacts() { return frame ? frame.contacts.length : 0; },
      get state() { return frame ? frame.state : ''; },
      get reason() { return frame ? frame.reason : ''; },
    }),
  });

  drawBar();
  trace.draw(0);
  connect();
  requestAnimationFrame(turn);
})();
