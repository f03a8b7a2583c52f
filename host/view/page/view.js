/* The page: messages from the program (host/view/message.h), panels, keyboard and mouse (host/view/command.h). */
'use strict';

(function () {
  const $ = (id) => document.getElementById(id);
  const KEY_SPEED_M_S = 0.06, KEY_TAP_M = 0.002;

  let stage = null, hello = null, frame = null, socket = null, retry_ms = 500;
  const trace = new Trace($('trace'));
  const seen = {frames: 0, first_s: 0, last_s: 0, max_mm: 0, peak_N: [], history: []};
  const HISTORY = 20000; // points of the force kept for readers of window.trocar
  let selected = 0; // whose hand keys and mouse move, whose health is shown
  let targets = []; // of the hands, trocar's frame, while this page moves them
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
      targets = [];
      setTimeout(connect, retry_ms);
      retry_ms = Math.min(8000, retry_ms * 2);
    };
  }

  function greet(message) {
    hello = message;
    retry_ms = 500;
    trace.clear(hello.instruments.length);
    targets = [];
    $('scene').textContent = [hello.scene, hello.vertices + ' surface vertices', hello.triangles + ' triangles'].filter(Boolean).join(' \u00b7 ');
    document.title = (hello.scene ? hello.scene + ' \u2013 ' : '') + 'Trocar';
    buildHealth();
    buildTiles();
    buildHands();
    $('legend-hold').hidden = !hello.jaws;
    if (stage) {
      stage.build(hello);
      setRange(0.005);
      setArrow(1);
    }
  }

  function receive(message) {
    frame = message;
    const newtons = frame.instruments.map((i) => Math.hypot(...i.force_N)), max_mm = 1000 * (frame.max_m || 0);
    if (!seen.frames) seen.first_s = frame.time_s;
    seen.frames++;
    seen.last_s = frame.time_s;
    seen.max_mm = Math.max(seen.max_mm, max_mm);
    frame.instruments.forEach((state, i) => {
      seen.peak_N[i] = Math.max(seen.peak_N[i] || 0, newtons[i]);
      trace.add(i, state.trace);
    });
    for (const [t, N] of frame.instruments[0].trace) seen.history.push({time_s: t, force_N: N});
    if (seen.history.length > HISTORY) seen.history.splice(0, seen.history.length - HISTORY);

    peaks.push([frame.time_s, max_mm / 1000, Math.max(...newtons)]);
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

  const nameOf = (i) => hello.instruments[i].name || ['first', 'second'][i];
  const several = () => hello.instruments.length > 1;

  /* The state that matters most: silent, SAFE, not yet started, RUN. */
  function worst() {
    const rank = (i) => (i.silent_s > 1.5 ? 0 : 1 + ['SAFE', 'INIT', 'READY', 'RUN'].indexOf(i.state));
    const number = frame.instruments.reduce((best, i, k) => (rank(i) < rank(frame.instruments[best]) ? k : best), 0);
    return {...frame.instruments[number], who: several() ? nameOf(number) + ': ' : ''};
  }

  function showState() {
    const of = worst(), silent = of.silent_s > 1.5;
    badge(silent ? 'SILENT' : of.state);
    if (silent) notice(of.who + 'Nothing was heard from the controller for ' + of.silent_s.toFixed(1) + ' s: check its power and the bus.', '', false);
    else if (of.state === 'SAFE') notice(of.who + 'Torque is off: ' + (of.reason ? of.meaning + ' (' + of.reason + '). Then ' + of.remedy + '.' : 'stopped on request.'), '', true);
    else if (of.state === 'READY') notice(of.who + 'The controller is ready; torque is off until it is acknowledged.', 'info', true);
    else if (frame.field_error) notice('The displacement cannot be shown: ' + frame.field_error + '.', '', false);
    else notice('', '', false);
    $('stop').disabled = !frame.instruments.some((i) => i.state === 'RUN');
  }

  /* A tile per force, before that of the displacement. */
  function buildTiles() {
    const tiles = $('tiles');
    tiles.querySelectorAll('.force').forEach((tile) => tile.remove());
    tiles.classList.toggle('three', several());
    hello.instruments.forEach((_, i) => {
      const tile = document.createElement('div');
      tile.className = 'tile force' + (i ? ' second' : '');
      tile.innerHTML = '<div class="label"></div><div class="value"><span>0.00</span><small>N</small></div>';
      tile.querySelector('.label').textContent = several() ? 'Force, ' + nameOf(i) : 'Force on hand';
      tiles.insertBefore(tile, tiles.lastElementChild);
    });
    tiles.lastElementChild.querySelector('.label').textContent = several() ? 'Moved, max' : 'Displacement, max';
    document.querySelector('.swatch.arrow.second').hidden = !several();
  }

  /* With two instruments: whose hand is moved. */
  function buildHands() {
    $('hands').hidden = $('switch').hidden = !several();
    $('hands').textContent = '';
    hello.instruments.forEach((_, i) => {
      const button = document.createElement('button');
      button.type = 'button';
      button.textContent = nameOf(i);
      button.addEventListener('click', () => select(i));
      $('hands').append(button);
    });
    select(Math.min(selected, hello.instruments.length - 1));
  }

  function select(number) {
    if (!hello || number >= hello.instruments.length) return;
    selected = number;
    held.clear();
    if (stage) stage.select(number);
    [...$('hands').children].forEach((button, i) => { button.className = (i ? 'second' : '') + (i === number ? ' selected' : ''); });
    $('health-caption').textContent = 'Health' + (several() ? ', ' + nameOf(number) : '');
    $('driven-name').textContent = several() ? 'the ' + nameOf(number) + ' instrument' : 'the instrument';
  }

  const mine = () => frame && frame.instruments[selected];

  /* Health, but for what only a program compares. Names of what is information rather than a loss are not emphasised. */
  const UNSHOWN = /^state_hash$|^hash_tick$/, PLAIN = /^tick|^energy|^row_work|^worst_tick|^Frames dropped/;
  let cells = [];
  function buildHealth() {
    const body = $('health').tBodies[0];
    const shown = hello.health_names.map((name, i) => ({name, value: (state) => state.health[i]})).filter(({name}) => !UNSHOWN.test(name));
    shown.push({name: 'Frames dropped', value: () => frame.dropped}, {name: 'Messages refused', value: () => frame.malformed});
    const rows = Math.ceil(shown.length / 2);
    body.textContent = '';
    for (let r = 0; r < rows; r++) body.insertRow();
    cells = shown.map(({name, value}, i) => {
      const row = body.rows[i % rows], energy = /_100uJ$/.test(name); // a value's unit is the last part of its name
      row.insertCell().textContent = name.replace(/_100uJ$/, ' [mJ]').replace(/_us$/, ' [\u00b5s]').replace(/_/g, ' ').replace(/^./, (c) => c.toUpperCase());
      const cell = row.insertCell();
      cell.className = 'n';
      return {cell, plain: PLAIN.test(name), value, text: (v) => (energy ? (0.1 * v).toFixed(1) : String(v))};
    });
  }

  function showHealth() {
    const state = mine();
    if (!state) return;
    for (const {cell, plain, value, text} of cells) {
      const now = value(state), shown = text(now);
      if (cell.textContent !== shown) cell.textContent = shown;
      cell.classList.toggle('count', now > 0 && !plain);
    }
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
    document.querySelectorAll('.tile.force .value span').forEach((value, i) => {
      value.textContent = frame.instruments[i] ? Math.hypot(...frame.instruments[i].force_N).toFixed(2) : '\u2013';
    });
    $('displacement').textContent = (1000 * (frame.max_m || 0)).toFixed(1);
    $('driven').hidden = !(mine() && mine().driven);
    /* over some seconds, because the browser itself holds messages up for parts of one */
    const now = performance.now();
    if (now - rate.wall > 5000) {
      const share = 1000 * (frame.time_s - rate.time) / (now - rate.wall);
      if (rate.wall && share > 0) $('rate').textContent = Math.abs(share - 1) < 0.1 ? 'real time' : Math.round(100 * share) + ' % of real time';
      rate = {wall: now, time: frame.time_s};
    }
  }

  function placeLabels() {
    document.querySelectorAll('.force-label').forEach((label, i) => {
      const state = frame && frame.instruments[i], at = stage && state ? stage.arrowOnScreen(i) : null;
      label.hidden = !at;
      if (!at) return;
      label.textContent = Math.hypot(...state.force_N).toFixed(2) + ' N';
      label.style.transform = 'translate(' + Math.round(at.x + 18) + 'px,' + Math.round(at.y - 12) + 'px)';
    });
  }

  /* ---- the hand ---- */

  const KEYS = {
    ArrowLeft: [-1, 0, 0], KeyA: [-1, 0, 0], ArrowRight: [1, 0, 0], KeyD: [1, 0, 0],
    ArrowUp: [0, 1, 0], KeyW: [0, 1, 0], ArrowDown: [0, -1, 0], KeyS: [0, -1, 0],
    PageDown: [0, 0, 1], KeyE: [0, 0, 1], PageUp: [0, 0, -1], KeyQ: [0, 0, -1],
  };

  /* Right and up as seen on the screen, inwards along the instrument; metres. */
  function push(right, up, inwards) {
    if (!mine()) return;
    let target = targets[selected] || mine().hand_m.slice();
    const [x, y] = stage ? stage.across(right, up) : [right, up], length = Math.hypot(...target) || 1;
    target = target.map((v, i) => v + [x, y, 0][i] + inwards * v / length);
    const tool = hello.instruments[selected], reach = Math.hypot(...target) || 1;
    const scale = Math.min(1.1 * tool.joint_max[2], Math.max(0.9 * tool.joint_min[2], reach)) / reach;
    targets[selected] = target.map((v) => v * scale);
    unsent = true;
  }

  function release() {
    targets[selected] = null;
    unsent = false;
    send({hand: null, instrument: selected});
  }

  /* Keys that are held move the hand by the run's time, once per frame. */
  let moved_s = 0;
  function move() {
    const step = KEY_SPEED_M_S * Math.min(0.1, Math.max(0, frame.time_s - moved_s));
    moved_s = frame.time_s;
    for (const code of held) push(...KEYS[code].map((v) => v * step));
    if (unsent && targets[selected]) send({hand: targets[selected], instrument: selected});
    unsent = false;
  }

  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.code === 'Space' && event.target.tagName !== 'BUTTON' && event.target.tagName !== 'INPUT') {
      event.preventDefault();
      release();
    }
    if (hello && several() && (event.code === 'Digit1' || event.code === 'Digit2')) select(Number(event.code.slice(5)) - 1);
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
    if (stage && stage.render()) placeLabels();
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
      /* of the selected instrument, */
      get force_N() { return mine() ? Math.hypot(...mine().force_N) : 0; },
      get peak_force_N() { return seen.peak_N[selected] || 0; },
      get tip_m() { return mine() ? mine().tip_m.slice() : null; },
      get hand_m() { return mine() ? mine().hand_m.slice() : null; },
      get driven() { return Boolean(mine() && mine().driven); },
      get selected() { return selected; },
      /* of the first, */
      get force_history() { return seen.history.map((p) => ({...p})); },
      /* of all: the worst state, and each by itself */
      get state() { return frame ? worst().state : ''; },
      get reason() { return frame ? worst().reason : ''; },
      get instruments() {
        return !frame ? [] : frame.instruments.map((i, k) => ({
          name: nameOf(k), state: i.state, force_N: Math.hypot(...i.force_N), peak_force_N: seen.peak_N[k], tip_m: i.tip_m.slice(),
          hand_m: i.hand_m.slice(), driven: i.driven, grip: i.grip, contacts: i.contacts.length, held: i.held.length,
        }));
      },
    }),
  });

  drawBar();
  trace.draw(0);
  connect();
  requestAnimationFrame(turn);
})();
