// The motion of a surface, turned by the mouse, a finger or arrow keys: one canvas a figure of class "motion".
// x(t) = X + s sum_h (c_h cos h t + s_h sin h t); faces from the farthest to the nearest, those that look away left out.
"use strict";
for (const figure of document.querySelectorAll("figure.motion")) {
  const given = JSON.parse(figure.querySelector("script[type='application/json']").textContent);
  const numbers = (text, factor, Kind) => {
    const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
    return Float64Array.from(new Kind(bytes.buffer), value => factor * value);
  };
  const places = numbers(given.places, given.place_step, Int16Array);
  const series = given.series.map(text => numbers(text, given.series_step, Int16Array));
  const faces = numbers(given.faces, 1, Int32Array);
  const shade = numbers(given.shade, 1, Uint8Array);
  const count = places.length / 3, moved = new Float64Array(3 * count), seen = new Float64Array(3 * count);

  const live = figure.querySelector(".live"), canvas = live.querySelector("canvas"), pen = canvas.getContext("2d");
  const button = live.querySelector("button"), size = live.querySelector("input");
  let across = given.across, tilt = given.tilt, zoom = 1, phase = given.peak, last = 0;
  let playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  let visible = true;

  const move = () => {
    moved.set(places);
    const scale = given.scale * size.value;
    given.harmonics.forEach((h, index) => {
      const cosine = series[2 * index], sine = series[2 * index + 1];
      const c = scale * Math.cos(h * phase), s = scale * Math.sin(h * phase);
      for (let i = 0; i < 3 * count; i++) moved[i] += c * cosine[i] + s * sine[i];
    });
  };
  const draw = () => {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(ratio * width)) {
      canvas.width = Math.round(ratio * width);
      canvas.height = Math.round(ratio * height);
    }
    move();
    const unit = zoom * 0.46 * width / given.radius;
    const ca = Math.cos(across), sa = Math.sin(across), ct = Math.cos(tilt), st = Math.sin(tilt);
    for (let i = 0; i < count; i++) {
      const x = moved[3 * i], y = moved[3 * i + 1], z = moved[3 * i + 2];
      const right = ca * x + sa * y, away = -sa * x + ca * y;
      seen[3 * i] = width / 2 + unit * right;
      seen[3 * i + 1] = height / 2 - unit * (ct * z + st * away);
      seen[3 * i + 2] = st * z - ct * away;
    }
    const shown = [];
    for (let f = 0; f < faces.length; f += 4) {
      const corners = faces[f + 3] < 0 ? 3 : 4;
      let area = 0, depth = 0, colour = 0;
      for (let k = 0; k < corners; k++) {
        const a = 3 * faces[f + k], b = 3 * faces[f + (k + 1) % corners];
        area += seen[a] * seen[b + 1] - seen[b] * seen[a + 1];
        depth += seen[a + 2] / corners;
        colour += shade[a / 3] / corners;
      }
      if (area < 0) shown.push([depth, f, corners, colour]);
    }
    shown.sort((one, other) => one[0] - other[0]);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.lineWidth = 0.6;
    pen.lineJoin = "round";
    for (const [, f, corners, colour] of shown) {
      pen.beginPath();
      for (let k = 0; k < corners; k++) pen.lineTo(seen[3 * faces[f + k]], seen[3 * faces[f + k] + 1]);
      pen.closePath();
      pen.fillStyle = given.colours[Math.round(colour * (given.colours.length - 1) / 255)];
      pen.fill();
      pen.strokeStyle = "rgba(30,40,50,0.35)";
      pen.stroke();
    }
  };
  const step = now => {
    if (!playing) return;
    // One period in two seconds, however often the screen is drawn.
    if (visible) {
      phase = (phase + Math.PI * Math.min(now - last, 100) / 1000) % (2 * Math.PI);
      draw();
    }
    last = now;
    requestAnimationFrame(step);
  };
  const start = () => {
    last = performance.now();
    if (playing) requestAnimationFrame(step);
  };
  const label = () => { button.textContent = playing ? "Pause" : "Play"; };
  const turn = (right, up) => {
    across += right;
    tilt = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, tilt + up));
    draw();
  };

  canvas.style.aspectRatio = `${1 / given.shape}`;
  figure.classList.add("is-live");
  button.addEventListener("click", () => { playing = !playing; label(); start(); });
  size.addEventListener("input", draw);
  const grips = new Map();
  canvas.addEventListener("pointerdown", event => {
    grips.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", event => {
    const before = grips.get(event.pointerId);
    if (!before) return;
    grips.set(event.pointerId, [event.clientX, event.clientY]);
    turn(-0.01 * (event.clientX - before[0]), 0.01 * (event.clientY - before[1]));
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, event => grips.delete(event.pointerId));
  const keys = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
  canvas.addEventListener("keydown", event => {
    if (keys[event.key]) turn(...keys[event.key]);
    else if (event.key === "+" || event.key === "-") { zoom *= event.key === "+" ? 1.15 : 1 / 1.15; draw(); }
    else return;
    event.preventDefault();
  });
  live.querySelector(".nearer").addEventListener("click", () => { zoom *= 1.25; draw(); });
  live.querySelector(".farther").addEventListener("click", () => { zoom /= 1.25; draw(); });
  new IntersectionObserver(entries => { visible = entries[entries.length - 1].isIntersecting; }).observe(canvas);
  addEventListener("resize", draw);
  label();
  draw();
  start();
}
