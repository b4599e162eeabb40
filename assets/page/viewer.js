// SPDX-License-Identifier: GPL-3.0-or-later
// The viewer of a site's page: terrain, paths and blocks that move along them. THREE is three.min.js beside this file.
"use strict";
(() => {
  const show = JSON.parse(document.getElementById("show").textContent);
  const $ = (id) => document.getElementById(id);
  const KINDS = { uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array, float32: Float32Array };
  const LINGER_S = 0.4, RATES = [0.25, 0.5, 1], RATE_NAMES = ["¼×", "½×", "1×"], NEAR_PX = 26;
  const ICONS = { view: "M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5", info: "M12 11v6M12 7.2v.1M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18z" };
  const state = { time: 0, rate: 1, playing: false, chosen: -1, language: show.language, hidden: new Set(), dirty: true };

  // ---- tables -------------------------------------------------------------------------------------------------
  function tables() {
    const packed = atob($("tables").textContent.trim());
    const bytes = new Uint8Array(packed.length);
    for (let i = 0; i < bytes.length; i++) bytes[i] = packed.charCodeAt(i);
    const all = THREE.unzlibSync(bytes), found = {};
    let at = 0;
    for (const [name, { kind, shape, differences }] of Object.entries(show.tables)) {
      const Kind = KINDS[kind], count = shape.reduce((a, b) => a * b, 1), size = Kind.BYTES_PER_ELEMENT;
      const plain = new Uint8Array(count * size); // stored: all first bytes, then all second ones, …
      for (let b = 0; b < size; b++) for (let i = 0; i < count; i++) plain[i * size + b] = all[at + b * count + i];
      at += count * size;
      const values = new Kind(plain.buffer), columns = shape[1] || 1;
      if (differences) for (let i = columns; i < count; i++) values[i] += values[i - columns];
      found[name] = values;
    }
    return found;
  }

  // ---- motion: the same cubic between rows as in the core -----------------------------------------------------
  const T = tables();
  const where = new THREE.Vector3(), quaternion = new THREE.Quaternion(), step = new THREE.Quaternion(), axis = new THREE.Vector3();

  function turnsOf(block) { // quaternions at each row, from the spin of each row to the next
    const turns = new Float64Array(4 * (block.rows[1] - block.rows[0]));
    quaternion.identity();
    for (let i = block.rows[0], k = 0; i < block.rows[1]; i++, k += 4) {
      quaternion.toArray(turns, k);
      if (i + 1 < block.rows[1]) turn(quaternion, i, T.time[i + 1] - T.time[i]);
    }
    return turns;
  }
  function turn(into, row, seconds) {
    axis.fromArray(T.spin, 3 * row);
    const rate = axis.length();
    if (rate > 1e-12) into.premultiply(step.setFromAxisAngle(axis.divideScalar(rate), rate * seconds)).normalize();
    return into;
  }
  function rowAt(block, time) { // the last row up to a time
    let low = block.rows[0], high = block.rows[1];
    while (low < high) { const middle = (low + high) >> 1; if (T.time[middle] <= time) low = middle + 1; else high = middle; }
    return low - 1;
  }
  function stateAt(block, time) { // place, velocity, row; null before the start, in gaps, and once lost from sight
    const [first, end] = block.rows, last = end - 1;
    let phase = "moves";
    if (time < T.time[first]) { time = T.time[first]; phase = "waits"; }
    if (time >= T.time[last]) {
      if (!block.rests && time > T.time[last] + LINGER_S) return { phase: "lost", place: null, velocity: [0, 0, 0], row: last, since: 0 };
      phase = block.rests ? "rests" : "lost";
      const place = [0, 1, 2].map((k) => T.place[3 * last + k]);
      return { phase, place, velocity: [0, 0, 0], row: last, since: 0 };
    }
    const i = rowAt(block, time), since = time - T.time[i];
    if (since > 0 && T.chain[i] !== T.chain[i + 1]) return { phase: "lost", place: null, velocity: [0, 0, 0], row: i, since: 0 };
    const length = T.time[i + 1] - T.time[i], s = length > 0 ? since / length : 0, place = [], velocity = [];
    for (let k = 0; k < 3; k++) {
      const p0 = T.place[3 * i + k], p1 = T.place[3 * i + 3 + k], v0 = T.velocity[3 * i + k], v1 = T.velocity[3 * i + 3 + k];
      const m0 = length * v0, m1 = length * v1, way = p1 - p0;
      place.push(p0 + s * (m0 + s * (3 * way - 2 * m0 - m1 + s * (m0 + m1 - 2 * way))));
      velocity.push(phase === "waits" ? 0 : v0 + s * (v1 - v0));
    }
    return { phase, place, velocity, row: i, since };
  }
  function turnAt(block, now) {
    quaternion.fromArray(block.turns, 4 * (now.row - block.rows[0]));
    return turn(quaternion, now.row, now.since);
  }

  // ---- words --------------------------------------------------------------------------------------------------
  const say = (key, values = {}) => show.texts[state.language][key].replace(/\{(\w+)\}/g, (all, name) => values[name] ?? all);
  const number = (value, digits = 2) => new Intl.NumberFormat(state.language, { maximumSignificantDigits: digits }).format(value);
  const fixed = (value, decimals) => new Intl.NumberFormat(state.language, { minimumFractionDigits: decimals, maximumFractionDigits: decimals }).format(value);
  const mass = (kg) => (kg >= 1000 ? `${number(kg / 1000)} t` : `${number(kg)} kg`);
  const energy = (j) => (j >= 1e6 ? `${number(j / 1e6)} MJ` : j >= 1e3 ? `${number(j / 1e3)} kJ` : `${number(j)} J`);
  const groupName = (group) => (group.measured ? say("measured") : `${say("simulated")}: ${group.title}`);

  // ---- scene --------------------------------------------------------------------------------------------------
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ canvas: $("canvas"), antialias: true, alpha: true, preserveDrawingBuffer: show.keep });
  } catch (error) {
    words();
    $("problem").textContent = say("no_drawing");
    $("problem").hidden = false;
    window.rockfall = { ready: false };
    return;
  }
  THREE.ColorManagement.enabled = false; // all colours are sRGB, as the films mix them
  renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(36, 1, 0.2, 20000);
  camera.up.set(0, 0, 1);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8a86, 1.9));
  const sun = new THREE.DirectionalLight(0xffffff, 2.2);
  sun.position.fromArray(show.sun);
  scene.add(sun);

  let ground = null;
  if (show.terrain) {
    const { low, step: grid } = show.terrain, count = T.vertices.length / 3, places = new Float32Array(3 * count);
    for (let i = 0; i < places.length; i++) places[i] = low[i % 3] + grid[i % 3] * T.vertices[i];
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(T.colours, 3, true));
    geometry.setIndex(new THREE.BufferAttribute(T.faces, 1));
    const material = { vertexColors: true, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4 };
    ground = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ ...material, side: THREE.FrontSide }));
    scene.add(ground);
    const below = new THREE.MeshBasicMaterial({ color: 0x55524d, side: 1, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4 });
    scene.add(new THREE.Mesh(geometry, below)); // the underside is plain: nobody takes it for a slope
  }

  const solid = new THREE.BufferGeometry();
  solid.setAttribute("position", new THREE.BufferAttribute(T.solid, 3));
  const dot = (() => {
    const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
    canvas.width = canvas.height = 64;
    pen.fillStyle = "rgba(18,20,22,.85)"; pen.beginPath(); pen.arc(32, 32, 31, 0, 7); pen.fill();
    pen.fillStyle = "#fff"; pen.beginPath(); pen.arc(32, 32, 21, 0, 7); pen.fill();
    return new THREE.CanvasTexture(canvas);
  })();

  const lineMaterials = [];
  function lines(geometry, color, width, opacity, order, more = {}) {
    const material = new THREE.LineMaterial({ color, linewidth: width, transparent: true, opacity, depthWrite: false, ...more });
    lineMaterials.push(material);
    const made = new THREE.LineSegments2(geometry, material);
    made.frustumCulled = false;
    made.renderOrder = order;
    return made;
  }
  function segmentsOf(blocks) { // those of all blocks, by the time at which they end
    const found = [];
    for (const block of blocks) for (let i = block.rows[0]; i + 1 < block.rows[1]; i++)
      if (T.chain[i] === T.chain[i + 1] && T.time[i + 1] > T.time[i]) found.push(i);
    found.sort((a, b) => T.time[a + 1] - T.time[b + 1]);
    const places = new Float32Array(6 * found.length), ends = new Float32Array(found.length);
    found.forEach((row, k) => { places.set(T.place.subarray(3 * row, 3 * row + 6), 6 * k); ends[k] = T.time[row + 1]; });
    return { places, ends };
  }
  function geometryOf(places) {
    const made = new THREE.LineSegmentsGeometry();
    made.setPositions(places.length ? places : new Float32Array(6));
    return made;
  }

  show.blocks.forEach((block, i) => { block.index = i; block.turns = turnsOf(block); });
  const groups = show.groups.map((group, g) => {
    const blocks = show.blocks.filter((block) => block.group === g), { places, ends } = segmentsOf(blocks);
    const whole = geometryOf(places), grown = geometryOf(places), heads = geometryOf(new Float32Array(6 * blocks.length));
    const base = new THREE.Group(), many = blocks.length > 40;
    if (group.measured) {
      base.add(lines(whole, 0x14171a, 3.2, 0.3, 4), lines(whole, group.colour, 1.4, 0.45, 5));
      for (const geometry of [grown, heads]) base.add(lines(geometry, 0x14171a, 5.4, 0.6, 6), lines(geometry, group.colour, 2.6, 1, 7));
    } else {
      base.add(lines(whole, group.colour, many ? 1 : 1.4, group.opacity * 0.45, 1));
      for (const geometry of [grown, heads]) base.add(lines(geometry, group.colour, many ? 1.3 : 2, Math.min(1.6 * group.opacity, 1), 2));
    }
    const bodies = new THREE.InstancedMesh(solid, new THREE.MeshLambertMaterial({ color: group.colour, flatShading: true }), blocks.length);
    bodies.frustumCulled = false;
    const marks = new THREE.BufferGeometry();
    marks.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * blocks.length), 3));
    const size = group.measured ? 11 : blocks.length > 100 ? 6 : 8;
    const points = new THREE.Points(marks, new THREE.PointsMaterial({ color: group.colour, map: dot, size, sizeAttenuation: false, transparent: true, depthWrite: false }));
    points.frustumCulled = false;
    points.renderOrder = group.measured ? 9 : 8;
    base.add(bodies, points);
    scene.add(base);
    return { ...group, blocks, ends, grown, heads, base, bodies, points, marks, size };
  });
  const chosenLine = lines(geometryOf(new Float32Array(6)), 0xffffff, 4, 1, 10);
  const chosenHalo = lines(chosenLine.geometry, 0x14171a, 7, 0.7, 9);
  chosenLine.visible = chosenHalo.visible = false;
  scene.add(chosenHalo, chosenLine);

  const person = (() => {
    if (!show.person) return null;
    const canvas = document.createElement("canvas"), pen = canvas.getContext("2d"), half = show.person.outline;
    canvas.width = 128; canvas.height = 256;
    const at = ([x, y], side) => [64 + side * x * 246, 251 - y * 246];
    const outline = () => {
      pen.beginPath();
      half.forEach((p) => pen.lineTo(...at(p, 1)));
      [...half].reverse().forEach((p) => pen.lineTo(...at(p, -1)));
      pen.closePath();
      pen.moveTo(...at([show.person.head[1], show.person.head[0]], 1));
      pen.arc(...at([0, show.person.head[0]], 1), show.person.head[1] * 246, 0, 7);
    };
    pen.lineJoin = "round"; pen.strokeStyle = "rgba(18,20,22,.9)"; pen.lineWidth = 9; outline(); pen.stroke();
    pen.fillStyle = "#fff"; outline(); pen.fill();
    const map = new THREE.CanvasTexture(canvas);
    const made = new THREE.Sprite(new THREE.SpriteMaterial({ map, transparent: true, depthWrite: false }));
    const height = show.person.height * 256 / 246;
    made.scale.set(height / 2, height, 1);
    made.center.set(0.5, 5 / 256);
    made.position.fromArray(show.person.place);
    made.renderOrder = 3;
    scene.add(made);
    return made;
  })();

  // ---- view ---------------------------------------------------------------------------------------------------
  const controls = new THREE.OrbitControls(camera, $("canvas"));
  controls.enableDamping = true;
  controls.dampingFactor = 0.12;
  controls.maxPolarAngle = Math.PI * 0.62; // cliffs are looked up at
  controls.zoomToCursor = true;
  controls.addEventListener("change", () => { state.dirty = true; });
  controls.addEventListener("start", hintGone);
  const size = new THREE.Vector2(1, 1), sight = new THREE.Vector3(), right = new THREE.Vector3(), upward = new THREE.Vector3();
  function wholeSite() {
    // From the direction that the core has chosen, so near that all measured paths are in the picture.
    const forward = sight.fromArray(show.view.forward).normalize().clone(), aspect = size.x / size.y;
    right.crossVectors(forward, camera.up).normalize();
    upward.crossVectors(right, forward);
    const half = Math.tan((camera.fov * Math.PI) / 360);
    const stage = $("stage").getBoundingClientRect(), foot = document.querySelector("footer").getBoundingClientRect();
    const head = size.x < 640 ? document.querySelector("header").getBoundingClientRect().bottom - stage.top : 0;
    const part = (pixels) => Math.max(1 - (2 * pixels) / size.y, 0.15); // of half the picture's height that is free
    const free = { side: 0.88, top: part(head + 26), bottom: part(stage.bottom - foot.top + 18) };
    const target = new THREE.Vector3().fromArray(show.view.target), point = new THREE.Vector3();
    let distance = 2;
    for (const place of show.view.points) {
      point.fromArray(place).sub(target);
      const depth = point.dot(forward), up = point.dot(upward);
      distance = Math.max(distance, Math.abs(point.dot(right)) / (half * aspect * free.side) - depth, (up > 0 ? up / free.top : -up / free.bottom) / half - depth);
    }
    controls.target.copy(target);
    camera.position.copy(target).addScaledVector(forward, -distance);
    controls.maxDistance = 12 * distance;
    controls.minDistance = 0.5;
    controls.update();
    state.dirty = true;
  }
  let sized = false;
  function resize() {
    const box = $("stage").getBoundingClientRect();
    if (!box.width || !box.height) return;
    size.set(box.width, box.height);
    camera.aspect = size.x / size.y;
    camera.fov = camera.aspect < 0.8 ? 52 : 36;
    camera.updateProjectionMatrix();
    renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
    renderer.setSize(size.x, size.y, false);
    for (const material of lineMaterials) material.resolution.set(size.x, size.y);
    if (!sized) { sized = true; wholeSite(); }
    state.dirty = true;
  }
  new ResizeObserver(resize).observe($("stage"));

  // Turning and zooming is about the ground under the pointer: else one would zoom through it.
  const caster = new THREE.Raycaster(), pointer = new THREE.Vector2();
  let anchored = -1e9;
  function anchor(event) {
    const now = performance.now();
    if (!ground || now - anchored < 400) { if (event.type === "wheel") anchored = now; return; }
    anchored = now;
    const box = $("canvas").getBoundingClientRect();
    pointer.set((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
    camera.updateMatrixWorld();
    caster.setFromCamera(pointer, camera);
    const hit = caster.intersectObject(ground, false)[0];
    if (!hit) return;
    camera.getWorldDirection(sight);
    const depth = where.copy(hit.point).sub(camera.position).dot(sight);
    if (depth > controls.minDistance) controls.target.copy(camera.position).addScaledVector(sight, depth);
  }
  for (const kind of ["wheel", "pointerdown"]) $("canvas").addEventListener(kind, anchor, { capture: true, passive: true });

  const onScreen = new THREE.Vector3();
  function screen(place) { // pixels from the upper left corner; null behind the camera
    onScreen.fromArray(place).project(camera);
    return onScreen.z > 1 ? null : [((onScreen.x + 1) / 2) * size.x, ((1 - onScreen.y) / 2) * size.y];
  }
  const pixelsPerMetre = (distance) => size.y / (2 * Math.tan((camera.fov * Math.PI) / 360) * Math.max(distance, 1e-6));

  // ---- a moment -----------------------------------------------------------------------------------------------
  const matrix = new THREE.Matrix4(), stretch = new THREE.Vector3();
  const nowhere = new THREE.Matrix4().makeScale(0, 0, 0);
  function draw() {
    for (const group of groups) {
      if (!group.base.visible) continue;
      let low = 0, high = group.ends.length;
      while (low < high) { const middle = (low + high) >> 1; if (group.ends[middle] <= state.time) low = middle + 1; else high = middle; }
      group.grown.instanceCount = low;
      const marks = group.marks.attributes.position, starts = group.heads.attributes.instanceStart.data;
      group.blocks.forEach((block, k) => {
        const now = stateAt(block, state.time);
        block.now = now;
        if (!now.place) {
          group.bodies.setMatrixAt(k, nowhere);
          marks.setXYZ(k, 0, 0, 1e7);
          starts.array.fill(1e7, 6 * k, 6 * k + 6);
          return;
        }
        where.fromArray(now.place);
        group.bodies.setMatrixAt(k, matrix.compose(where, turnAt(block, now), stretch.fromArray(block.size)));
        const from = now.phase === "moves" ? 3 * now.row : -1;
        for (let c = 0; c < 3; c++) {
          starts.array[6 * k + c] = from < 0 ? now.place[c] : T.place[from + c];
          starts.array[6 * k + 3 + c] = now.place[c];
        }
        const distance = where.distanceTo(camera.position), across = Math.max(...block.size) * pixelsPerMetre(distance);
        if (across > group.size * 0.9) marks.setXYZ(k, 0, 0, 1e7);
        else {
          where.lerp(camera.position, Math.min(0.015 + block.size[0] / distance, 0.5)); // before the slope that it lies on
          marks.setXYZ(k, where.x, where.y, where.z);
        }
      });
      group.bodies.instanceMatrix.needsUpdate = marks.needsUpdate = starts.needsUpdate = true;
    }
    card();
    measures();
    renderer.render(scene, camera);
  }
  function measures() {
    const distance = camera.position.distanceTo(controls.target), scale = pixelsPerMetre(distance), raw = 110 / scale;
    const power = 10 ** Math.floor(Math.log10(raw)), length = [5, 2, 1].find((n) => n * power <= raw) * power;
    $("scale-length").textContent = length >= 1000 ? `${number(length / 1000)} km` : `${number(length)} m`;
    $("scale").style.width = `${length * scale}px`;
    camera.getWorldDirection(sight);
    $("north").style.transform = `rotate(${-Math.atan2(sight.x, sight.y)}rad)`;
    if (person) {
      const far = camera.position.distanceTo(person.position), tall = show.person.height * pixelsPerMetre(far), at = screen(show.person.place);
      $("person").hidden = !at || tall < 26;
      if (at) $("person").style.transform = `translate(${at[0] + tall * 0.3}px, ${at[1] - tall * 0.55}px)`;
    }
  }
  function card() {
    const block = show.blocks[state.chosen];
    const now = block && block.now, at = now && now.place && screen(now.place);
    $("card").hidden = !block;
    if (!block) return;
    const group = groups[block.group], speed = Math.hypot(...now.velocity);
    $("card").style.setProperty("--mark", group.colour);
    $("card-name").textContent = block.label;
    $("card-kind").textContent = groupName(group);
    $("card-motion").textContent = now.phase === "moves" ? `${say("moves", { v: fixed(speed, 1) })} · ${say("energy", { e: energy(0.5 * block.mass * speed * speed) })}` : say(now.phase);
    $("card-size").textContent = say("size", { d: block.size.map((d) => fixed(d, 2)).join(" × "), m: mass(block.mass) });
    const box = $("card").getBoundingClientRect();
    if (at) block.seen = at;
    const [x, y] = block.seen || [size.x / 2, size.y / 2];
    const left = Math.min(Math.max(x + 16, 8), size.x - box.width - 8), top = Math.min(Math.max(y - box.height - 14, 8), size.y - box.height - 100);
    $("card").style.transform = `translate(${left}px, ${top}px)`;
  }
  function choose(index) {
    state.chosen = index;
    chosenLine.visible = chosenHalo.visible = index >= 0;
    if (index >= 0) {
      const block = show.blocks[index];
      chosenLine.geometry = chosenHalo.geometry = geometryOf(segmentsOf([block]).places);
      chosenLine.material.color.set(groups[block.group].colour);
    }
    hintGone();
    state.dirty = true;
  }
  function nearest(x, y) { // the block, or else the path, that is nearest to a place on the screen
    let best = -1, least = NEAR_PX;
    for (const group of groups) {
      if (!group.base.visible) continue;
      for (const block of group.blocks) {
        const at = block.now && block.now.place && screen(block.now.place);
        const away = at ? Math.hypot(at[0] - x, at[1] - y) - (group.measured ? 4 : 0) : Infinity;
        if (away < least) { least = away; best = block.index; }
      }
    }
    if (best >= 0) return best;
    least = NEAR_PX / 2;
    for (const group of groups) {
      if (!group.base.visible) continue;
      for (const block of group.blocks) for (let i = block.rows[0]; i < block.rows[1]; i += 2) {
        const at = screen([T.place[3 * i], T.place[3 * i + 1], T.place[3 * i + 2]]);
        const away = at ? Math.hypot(at[0] - x, at[1] - y) + (group.measured ? 0 : 3) : Infinity;
        if (away < least) { least = away; best = block.index; }
      }
    }
    return best;
  }

  // ---- what a person does -------------------------------------------------------------------------------------
  const PLAY = "M8 5v14l11-7z", PAUSE = "M7 5h4v14H7zM13 5h4v14h-4z";
  function setPlaying(on) {
    if (on && state.time >= show.duration - 1e-6) state.time = 0;
    state.playing = on;
    $("play").setAttribute("aria-label", say(on ? "pause" : "play"));
    $("play").title = say(on ? "pause" : "play");
    $("play").querySelector("path").setAttribute("d", on ? PAUSE : PLAY);
    state.dirty = true;
  }
  function setTime(time) {
    state.time = Math.min(Math.max(time, 0), show.duration);
    state.dirty = true;
  }
  function clock() {
    $("slider").value = state.time;
    $("slider").setAttribute("aria-valuetext", `${fixed(state.time, 1)} s`);
    const pace = `${RATE_NAMES[RATES.indexOf(state.rate)]} ${say(state.rate === 1 ? "real_time" : "slower")}`;
    $("clock").innerHTML = "";
    $("clock").append(`${fixed(state.time, 1)} / ${fixed(show.duration, 1)} s`);
    const small = document.createElement("small");
    small.textContent = pace;
    $("clock").append(document.createElement("br"), small);
  }
  function hintGone() { $("hint").classList.add("gone"); }

  function words() {
    document.documentElement.lang = state.language;
    $("title").textContent = show.title;
    $("subtitle").textContent = show.subtitle;
    $("subtitle").hidden = !show.subtitle;
    $("hint").textContent = say("choose");
    for (const name of ["view", "info"]) {
      const label = say(name === "info" ? "about" : name);
      $(name).title = label;
      $(name).setAttribute("aria-label", label);
      $(name).innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${ICONS[name]}"/></svg>`;
    }
    $("language").setAttribute("aria-label", say("language"));
    $("slider").setAttribute("aria-label", say("time"));
    $("rates").setAttribute("aria-label", say("speed"));
    $("person").textContent = say("person");
    $("legend").replaceChildren(...show.groups.map((group, g) => {
      const row = document.createElement("li"), button = document.createElement("button"), mark = document.createElement("i");
      const text = document.createElement("span"), name = document.createElement("b"), count = document.createElement("small");
      mark.style.setProperty("--mark", group.colour);
      name.textContent = group.measured ? say("measured") : say("simulated");
      const n = group.count === 1 ? say("block") : say("blocks", { n: number(group.count, 6) });
      count.textContent = group.measured ? n : `${group.title}${group.random ? "" : `, ${say("without_chance")}`} · ${n}`;
      button.type = "button";
      button.setAttribute("aria-pressed", String(!state.hidden.has(g)));
      button.onclick = () => toggle(g);
      text.append(name, count);
      button.append(mark, text);
      row.append(button);
      return row;
    }));
    about();
  }
  function toggle(g) {
    if (state.hidden.has(g)) state.hidden.delete(g); else state.hidden.add(g);
    groups[g].base.visible = !state.hidden.has(g);
    if (state.chosen >= 0 && state.hidden.has(show.blocks[state.chosen].group)) choose(-1);
    words();
    state.dirty = true;
  }
  function about() {
    $("about-title").textContent = show.title;
    const some = (text, quiet) => { const p = document.createElement("p"); p.textContent = text; if (quiet) p.className = "quiet"; return p; };
    const simulated = show.groups.some((group) => !group.measured);
    const place = show.origin && say("place", { x: number(show.origin.x, 12), y: number(show.origin.y, 12), z: number(show.origin.z, 12), crs: show.origin.crs });
    $("about-text").replaceChildren(...[
      show.subtitle && some(show.subtitle),
      some(say("what_measured")),
      simulated && some(say("what_simulated")),
      some(say(show.together ? "together" : "observed")),
      some(say("turn")),
      show.credits && some(`${say("credits")}: ${show.credits}`),
      show.doi && some(`${say("data")}: doi:${show.doi}`),
      show.terrain && some(say("terrain", { n: number(show.terrain.faces, 3) }), true),
      place && some(place, true),
      some(say("made_with", { version: show.version }), true),
    ].filter(Boolean));
    $("close").textContent = say("close");
  }

  for (const [name, spoken] of Object.entries(show.texts)) $("language").append(new Option(name.toUpperCase(), name, false, name === state.language)), ($("language").lastChild.title = spoken.language);
  $("language").onchange = (event) => { state.language = event.target.value; words(); setPlaying(state.playing); clock(); };
  RATES.forEach((rate, i) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = RATE_NAMES[i];
    button.onclick = () => setRate(rate);
    $("rates").append(button);
  });
  function setRate(rate) {
    state.rate = rate;
    [...$("rates").children].forEach((button, i) => button.setAttribute("aria-pressed", String(RATES[i] === rate)));
    state.dirty = true;
  }
  $("slider").max = show.duration;
  $("slider").oninput = () => { setPlaying(false); setTime(Number($("slider").value)); };
  $("play").onclick = () => setPlaying(!state.playing);
  $("view").onclick = wholeSite;
  $("info").onclick = () => $("about").showModal();
  $("about").onclick = (event) => { if (event.target === $("about")) $("about").close(); };
  let down = null;
  $("canvas").addEventListener("pointerdown", (event) => { down = event.isPrimary ? [event.clientX, event.clientY] : null; });
  $("canvas").addEventListener("pointerup", (event) => {
    if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 6) return;
    const box = $("canvas").getBoundingClientRect();
    choose(nearest(event.clientX - box.left, event.clientY - box.top));
  });
  document.addEventListener("keydown", (event) => {
    if ($("about").open || event.target.tagName === "SELECT") return;
    if (event.key === " " && event.target.tagName !== "BUTTON") { event.preventDefault(); setPlaying(!state.playing); }
    if (event.key === "Escape") choose(-1);
    if (event.target.id !== "slider" && event.key === "ArrowRight") setTime(state.time + 0.1);
    if (event.target.id !== "slider" && event.key === "ArrowLeft") setTime(state.time - 0.1);
  });

  // ---- on it goes ---------------------------------------------------------------------------------------------
  const asked = new URLSearchParams(location.hash.slice(1)); // #t=2.5&lang=fr shows a moment, in a language
  if (show.texts[asked.get("lang")]) { state.language = asked.get("lang"); $("language").value = state.language; }
  words();
  setRate(1);
  resize();
  const at = Number.parseFloat(asked.get("t"));
  if (Number.isFinite(at)) setTime(at);
  setPlaying(!Number.isFinite(at) && !matchMedia("(prefers-reduced-motion: reduce)").matches);
  setTimeout(hintGone, 6000);
  let before = null;
  function frame(now) {
    const passed = before === null ? 0 : Math.min((now - before) / 1000, 0.25);
    before = now;
    if (state.playing) {
      setTime(state.time + passed * state.rate);
      if (state.time >= show.duration) setPlaying(false);
    }
    controls.update();
    if (state.dirty) { state.dirty = false; clock(); draw(); }
    requestAnimationFrame(frame);
  }
  requestAnimationFrame(frame);

  window.rockfall = { // for tests, and for pages around this one
    ready: true, duration: show.duration, names: show.blocks.map((block) => block.name),
    setTime: (time) => { setPlaying(false); setTime(time); state.dirty = false; clock(); draw(); },
    setPlaying, setRate, choose, nearest, wholeSite,
    time: () => state.time, playing: () => state.playing,
    placesAt: (time) => show.blocks.map((block) => stateAt(block, time).place),
    turnsAt: (time) => show.blocks.map((block) => turnAt(block, stateAt(block, time)).toArray()),
    drawn: () => groups.flatMap((group) => group.blocks.map((block, k) => { group.bodies.getMatrixAt(k, matrix); return [...matrix.elements]; })),
    camera: () => camera.position.toArray(),
    screen: (place) => { camera.updateMatrixWorld(); return screen(place); },
    segments: () => groups.map((group) => [group.grown.instanceCount, group.ends.length]),
  };
})();
