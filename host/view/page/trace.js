/* Forces over the last seconds, one line per instrument, on a 2D canvas: axes with units, a scale of round numbers that does not flicker. */
'use strict';

const TRACE_SPAN_S = 10;

class Trace {
  constructor(canvas) {
    this.canvas = canvas;
    this.lines = []; // per instrument [time_s, force_N], in order of time
  }

  /* For so many instruments. */
  clear(count) {
    this.lines = Array.from({length: count}, () => []);
  }

  add(number, points) {
    const line = this.lines[number];
    for (const point of points) {
      const last = line[line.length - 1];
      if (last && point[0] < last[0]) line.length = 0; // a new run has begun
      if (!last || point[0] !== last[0]) line.push(point);
    }
    const last = line[line.length - 1];
    if (!last) return;
    let stale = 0;
    while (stale < line.length && line[stale][0] < last[0] - TRACE_SPAN_S - 0.5) stale++;
    if (stale > 64) line.splice(0, stale);
  }

  /* Top of the scale and number of its steps: the smallest round number that holds the value. */
  static scale(value) {
    const power = Math.pow(10, Math.floor(Math.log10(Math.max(value, 1e-9))));
    const rounds = [[1, 4], [1.5, 3], [2, 4], [3, 3], [4, 4], [5, 5], [6, 3], [8, 4], [10, 5]];
    const [round, steps] = rounds.find(([r]) => r * power >= value * 0.999999);
    return {top: round * power, steps};
  }

  draw(now_s) {
    const canvas = this.canvas, ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !height) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const pen = canvas.getContext('2d');
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const left = 34, right = width - 8, top = 16, bottom = height - 32;

    let peak = 0;
    for (const line of this.lines)
      for (const [t, f] of line) if (t >= now_s - TRACE_SPAN_S) peak = Math.max(peak, f);
    const {top: limit, steps} = Trace.scale(Math.max(0.1, 1.05 * peak));
    const x = (t) => right + (t - now_s) / TRACE_SPAN_S * (right - left);
    const y = (f) => bottom - f / limit * (bottom - top);

    pen.font = '11px ' + getComputedStyle(document.body).fontFamily;
    pen.lineWidth = 1;
    pen.textAlign = 'right';
    pen.textBaseline = 'middle';
    for (let k = 0; k <= steps; k++) {
      const f = limit * k / steps, at = Math.round(y(f)) + 0.5;
      pen.strokeStyle = k ? '#e6ebef' : '#9aa7b2';
      pen.beginPath(); pen.moveTo(left, at); pen.lineTo(right, at); pen.stroke();
      pen.fillStyle = '#5d6b78';
      pen.fillText(String(Number(f.toPrecision(3))), left - 6, at);
    }
    pen.textBaseline = 'top';
    for (let k = 0; k <= 5; k++) {
      const back = TRACE_SPAN_S * k / 5, at = Math.round(x(now_s - back)) + (k ? 0.5 : -0.5);
      pen.strokeStyle = '#e6ebef';
      pen.beginPath(); pen.moveTo(at, top); pen.lineTo(at, bottom); pen.stroke();
      pen.textAlign = k === 0 ? 'right' : 'center';
      pen.fillText(k ? '\u2212' + back : 'now', k ? at : at + 6, bottom + 5);
    }
    pen.textAlign = 'left';
    pen.fillText('N', left - 15, 0);
    pen.textAlign = 'center';
    pen.fillText('time [s]', (left + right) / 2, bottom + 18);

    this.lines.forEach((line, number) => {
      const shown = line.filter(([t]) => t >= now_s - TRACE_SPAN_S && t <= now_s + 0.1);
      if (shown.length < 2) return;
      const colour = '#' + FORCE_COLOURS[number % FORCE_COLOURS.length].toString(16).padStart(6, '0');
      pen.beginPath();
      shown.forEach(([t, f], i) => (i ? pen.lineTo(x(t), y(f)) : pen.moveTo(x(t), y(f))));
      pen.strokeStyle = colour;
      pen.lineWidth = 1.8;
      pen.lineJoin = 'round';
      pen.stroke();
      pen.lineTo(x(shown[shown.length - 1][0]), bottom);
      pen.lineTo(x(shown[0][0]), bottom);
      pen.closePath();
      pen.fillStyle = colour + '1a';
      pen.fill();
    });
  }
}
