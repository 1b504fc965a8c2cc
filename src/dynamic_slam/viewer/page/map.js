// The map in three dimensions. In the world y points down, so everything hangs in a group that is turned over.
"use strict";

const COLOURS = {tracking: 0x3ddc84, initialising: 0xf2b84b, lost: 0xff5a4f, path: 0xf2b84b, keyframe: 0x5cb3ff, edge: 0x3f6f9f, loop: 0xe08cff, other: 0x59636f};
const FADE_IN_S = 0.5, FADE_OUT_S = 1.2, LOOP_S = 5;
const SLOW_S = 1 / 32, FAST_S = 1 / 45, STILL_S = 0.3;  // of the time from frame to frame; then of rest, before all is drawn
const MIN_POINTS = 10000, MAX_POINTS = 1e7;
const SHARED_S = 0.2;  // from frame to frame while the processor draws that tracks as well

const POINT_VERTEX = `
  attribute float born, died, part;
  uniform float now, pixels, low, high, current;
  varying vec4 tint;
  void main() {
    vec4 seen = modelViewMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * seen;
    float height = clamp((position.y - low) / max(high - low, 1e-6), 0.0, 1.0);
    float youth = 1.0 - clamp((now - born) / ${FADE_IN_S.toFixed(1)}, 0.0, 1.0);
    float death = died < 0.0 ? 0.0 : clamp((now - died) / ${FADE_OUT_S.toFixed(1)}, 0.0, 1.0);
    vec3 colour = mix(vec3(0.96, 0.93, 0.86), vec3(0.38, 0.55, 0.80), height);
    colour = mix(colour, vec3(0.45, 1.0, 0.65), youth);
    float share = 1.0;
    if (part != current) { colour = vec3(0.42, 0.46, 0.52); share = 0.5; }
    if (died >= 0.0) colour = vec3(1.0, 0.3, 0.25);
    tint = vec4(colour, (0.35 + 0.65 * (1.0 - youth)) * (1.0 - death) * share);
    gl_PointSize = clamp(pixels * 5.0 / -seen.z, 2.0 * pixels, 7.0 * pixels) * (1.0 + youth);
  }`;
const POINT_FRAGMENT = `
  varying vec4 tint;
  void main() {
    vec2 off = gl_PointCoord - 0.5;
    if (tint.a < 0.02 || dot(off, off) > 0.25) discard;
    gl_FragColor = tint;
  }`;

// Landmarks: each has a place in the arrays until it has faded away. The index has the places in random order, so that
// its first entries are a fair picture of the whole for a machine that cannot draw them all while the view moves.
class Points {
  constructor(parent) {
    this.material = new THREE.ShaderMaterial({
      vertexShader: POINT_VERTEX, fragmentShader: POINT_FRAGMENT, transparent: true, depthWrite: false,
      uniforms: {now: {value: 0}, pixels: {value: devicePixelRatio}, low: {value: -1}, high: {value: 1}, current: {value: 0}}});
    this.budget = MAX_POINTS;
    this.object = new THREE.Points(new THREE.BufferGeometry(), this.material);
    this.object.frustumCulled = false;
    parent.add(this.object);
    this.clear();
  }

  clear() {
    this.places = new Map();
    this.free = [];
    this.dying = [];
    this.used = 0;
    this.allocate(4096);
  }

  allocate(capacity) {
    const old = this.arrays;
    this.capacity = capacity;
    this.arrays = {position: new Float32Array(3 * capacity), born: new Float32Array(capacity), died: new Float32Array(capacity), part: new Float32Array(capacity), index: new Uint32Array(capacity)};
    this.object.geometry.dispose();
    const geometry = new THREE.BufferGeometry();
    for (const name in this.arrays) {
      const size = name === "position" ? 3 : 1;
      if (this.used > 0) this.arrays[name].set(old[name].subarray(0, size * this.used));
      const attribute = new THREE.BufferAttribute(this.arrays[name], size).setUsage(THREE.DynamicDrawUsage);
      if (name === "index") geometry.setIndex(attribute); else geometry.setAttribute(name, attribute);
    }
    this.object.geometry = geometry;
  }

  set(id, part, x, y, z, now) {
    let place = this.places.get(id);
    if (place === undefined) {
      place = this.free.length ? this.free.pop() : this.add();
      this.places.set(id, place);
      this.arrays.born[place] = now;
      this.arrays.died[place] = -1;
    }
    this.arrays.position[3 * place] = x;
    this.arrays.position[3 * place + 1] = y;
    this.arrays.position[3 * place + 2] = z;
    this.arrays.part[place] = part;
  }

  // A new place, shuffled into the index.
  add() {
    if (this.used >= this.capacity) this.allocate(2 * this.capacity);
    const {index} = this.arrays, at = Math.floor(Math.random() * (this.used + 1));
    index[this.used] = index[at];
    index[at] = this.used;
    return this.used++;
  }

  // How many are drawn, from how long the last frame took.
  adapt(seconds) {
    if (seconds > SLOW_S) this.budget = Math.max(MIN_POINTS, 0.8 * Math.min(this.budget, this.used));
    else if (seconds < FAST_S) this.budget = Math.min(MAX_POINTS, 1.1 * this.budget);
  }

  // All of them, or as many as can be drawn while the view moves. Returns whether that is all.
  choose(isStill) {
    const count = isStill ? this.used : Math.min(this.used, Math.floor(this.budget));
    this.object.geometry.setDrawRange(0, count);
    return count === this.used;
  }

  remove(id, now) {
    const place = this.places.get(id);
    if (place === undefined) return;
    this.places.delete(id);
    this.arrays.died[place] = now;
    this.dying.push([now, place]);
  }

  update(now) {
    while (this.dying.length && now - this.dying[0][0] > FADE_OUT_S) this.free.push(this.dying.shift()[1]);
    const geometry = this.object.geometry;
    for (const name in geometry.attributes) geometry.attributes[name].needsUpdate = true;
    geometry.index.needsUpdate = true;
    const heights = [], step = Math.max(1, Math.floor(this.used / 500));
    for (let i = 0; i < this.used; i += step) if (this.arrays.died[i] < 0) heights.push(this.arrays.position[3 * i + 1]);
    heights.sort((a, b) => a - b);
    if (heights.length > 4) {
      this.material.uniforms.low.value = heights[Math.floor(0.05 * heights.length)];
      this.material.uniforms.high.value = heights[Math.floor(0.95 * heights.length)];
    }
  }
}

// Lines that are drawn anew as a whole when they change.
function makeLines(parent, colour, opacity) {
  const lines = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({color: colour, transparent: opacity < 1, opacity}));
  lines.frustumCulled = false;
  parent.add(lines);
  return lines;
}

function setLines(lines, coordinates) {
  lines.geometry.dispose();
  lines.geometry = new THREE.BufferGeometry();
  lines.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(coordinates), 3));
}

// Corners of the image at this depth, in the camera.
function corners(camera, depth) {
  const x0 = -camera.cx / camera.fx, x1 = (camera.width - camera.cx) / camera.fx;
  const y0 = -camera.cy / camera.fy, y1 = (camera.height - camera.cy) / camera.fy;
  return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(([x, y]) => new THREE.Vector3(x * depth, y * depth, depth));
}

function addFrustum(pose, local, coordinates) {
  const turn = new THREE.Quaternion(pose[3], pose[4], pose[5], pose[6]), centre = new THREE.Vector3(pose[0], pose[1], pose[2]);
  const c = local.map((v) => v.clone().applyQuaternion(turn).add(centre));
  for (let i = 0; i < 4; ++i) {
    for (const v of [centre, c[i], c[i], c[(i + 1) % 4]]) coordinates.push(v.x, v.y, v.z);
  }
}

// Whether the processor does the drawing; smooth edges then cost more than half of the time.
function isDrawnInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl"), names = gl && gl.getExtension("WEBGL_debug_renderer_info");
  return Boolean(names) && /swiftshader|llvmpipe|software/i.test(gl.getParameter(names.UNMASKED_RENDERER_WEBGL));
}

class MapView {
  constructor(canvas) {
    this.canvas = canvas;
    this.isSoftware = isDrawnInSoftware();
    this.renderer = new THREE.WebGLRenderer({canvas, antialias: !this.isSoftware, preserveDrawingBuffer: true});
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setClearColor(0x0d1117);
    this.scene = new THREE.Scene();
    this.world = new THREE.Group();
    this.world.rotation.x = Math.PI;
    this.scene.add(this.world);
    this.eye = new THREE.PerspectiveCamera(50, 1, 0.01, 2000);
    this.eye.position.set(0, 1.2, 2.4);
    this.control = new THREE.OrbitControls(this.eye, canvas);
    this.control.addEventListener("change", () => this.redraw());
    this.control.addEventListener("start", () => { this.chases = false; this.isHeld = true; });
    this.control.addEventListener("end", () => { this.isHeld = false; });
    this.points = new Points(this.world);
    this.edges = makeLines(this.world, COLOURS.edge, 0.45);
    this.keyframeLines = makeLines(this.world, COLOURS.keyframe, 0.9);
    this.pathLines = makeLines(this.world, COLOURS.path, 1);
    this.otherLines = makeLines(this.world, COLOURS.other, 0.7);
    this.now = makeLines(this.world, COLOURS.tracking, 1);
    this.body = new THREE.Mesh(new THREE.BufferGeometry(),
                               new THREE.MeshBasicMaterial({color: COLOURS.tracking, transparent: true, opacity: 0.35, side: THREE.DoubleSide, depthWrite: false}));
    this.body.frustumCulled = false;
    this.world.add(this.body);
    this.follows = true;
    this.camera = {width: 640, height: 480, fx: 500, fy: 500, cx: 320, cy: 240};
    this.clear();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
    const draw = () => { requestAnimationFrame(draw); this.draw(); };
    draw();
  }

  clear() {
    this.points.clear();
    this.keyframes = new Map();
    this.path = [];
    for (const loop of this.loops || []) this.world.remove(loop.tube);
    this.loops = [];
    this.pose = null;
    this.placed = false;
    for (const lines of [this.edges, this.keyframeLines, this.pathLines, this.otherLines, this.now]) setLines(lines, []);
    setLines(this.body, []);
    this.redraw();
  }

  seconds() { return performance.now() / 1000; }

  redraw(forSeconds = 0) {
    this.drawUntil = Math.max(this.drawUntil || 0, this.seconds() + forSeconds);
    this.dirty = true;
  }

  resize() {
    const width = Math.max(1, this.canvas.parentElement.clientWidth), height = Math.max(1, this.canvas.parentElement.clientHeight);
    this.renderer.setSize(width, height, false);
    this.eye.aspect = width / height;
    this.eye.updateProjectionMatrix();
    this.redraw();
  }

  // A change as map_picture.cc writes it.
  apply(view, at, isWhole) {
    const now = this.seconds(), word = () => { at += 4; return view.getUint32(at - 4, true); };
    const float = () => { at += 4; return view.getFloat32(at - 4, true); };
    if (isWhole) { this.points.clear(); this.keyframes.clear(); this.path = []; }
    const count = word(), isMuch = isWhole || count > 20000;
    const ids = at, parts = at + 16 * count;
    at += 4 * count;
    for (let i = 0; i < count; ++i) {
      this.points.set(view.getUint32(ids + 4 * i, true), view.getUint32(parts + 4 * i, true), float(), float(), float(),
                      isMuch ? now - FADE_IN_S : now);
    }
    at += 4 * count;
    for (let n = word(); n > 0; --n) this.points.remove(word(), now);
    for (let n = word(); n > 0; --n) {
      const id = word(), part = word(), pose = [float(), float(), float(), float(), float(), float(), float()], neighbours = [];
      for (let k = word(); k > 0; --k) neighbours.push(word());
      this.keyframes.set(id, {part, pose, neighbours});
    }
    for (let n = word(); n > 0; --n) this.keyframes.delete(word());
    this.path.length = Math.min(this.path.length, word());
    for (let n = word(); n > 0; --n) this.path.push([float(), float(), float(), word(), word()]);
    this.points.material.uniforms.current.value = this.part = word();
    this.points.update(now);
    this.rebuild();
    this.redraw(FADE_OUT_S + 0.1);
  }

  // Parts of the map have worlds of their own until a place joins them; all but the camera's are grey.
  rebuild() {
    const frustums = [], edges = [], path = [], others = [], local = corners(this.camera, 0.045);
    for (const keyframe of this.keyframes.values()) {
      addFrustum(keyframe.pose, local, keyframe.part === this.part ? frustums : others);
      for (const id of keyframe.neighbours) {
        const other = this.keyframes.get(id);
        if (other && keyframe.part === this.part) edges.push(...keyframe.pose.slice(0, 3), ...other.pose.slice(0, 3));
      }
    }
    for (let i = 1; i < this.path.length; ++i) {
      const [from, to] = [this.path[i - 1], this.path[i]];
      if (to[3] === from[3] && to[4] === from[4]) (to[4] === this.part ? path : others).push(...from.slice(0, 3), ...to.slice(0, 3));
    }
    setLines(this.keyframeLines, frustums);
    setLines(this.edges, edges);
    setLines(this.pathLines, path);
    setLines(this.otherLines, others);
  }

  // The camera of the newest frame; without a pose it stays where it was last, in the colour of the state.
  show(pose, state) {
    const colour = COLOURS[state] || COLOURS.initialising;
    this.now.material.color.setHex(colour);
    this.body.material.color.setHex(colour);
    if (pose) {
      const last = this.pose;
      this.pose = pose;
      const local = corners(this.camera, 0.14), coordinates = [];
      addFrustum(pose, local, coordinates);
      setLines(this.now, coordinates);
      const faces = [];
      for (let i = 0; i < 24; i += 6) faces.push(...coordinates.slice(2 * i, 2 * i + 6), ...coordinates.slice(2 * i + 9, 2 * i + 12));
      setLines(this.body, faces);
      if (this.follows) this.follow(last);
    }
    this.redraw();
  }

  centre(pose) { return new THREE.Vector3(pose[0], -pose[1], -pose[2]); }

  // Keeps the eye behind the camera, softly; once the user has turned the view, it only goes along.
  follow(last) {
    const centre = this.centre(this.pose), turn = new THREE.Quaternion(this.pose[3], this.pose[4], this.pose[5], this.pose[6]);
    const ahead = new THREE.Vector3(0, 0, 1).applyQuaternion(turn);
    ahead.set(ahead.x, -ahead.y, -ahead.z);
    if (!this.placed || this.chases) {
      const share = this.placed ? 0.1 : 1;
      this.control.target.lerp(centre.clone().addScaledVector(ahead, 0.45), share);
      this.eye.position.lerp(centre.clone().addScaledVector(ahead, -1.15).add(new THREE.Vector3(0, 0.75, 0)), share);
      this.chases = this.placed ? this.chases : true;
      this.placed = true;
    } else if (last) {
      const step = centre.sub(this.centre(last));
      this.control.target.add(step);
      this.eye.position.add(step);
    }
    this.control.update();
  }

  setFollow(follows) {
    this.follows = follows;
    if (!follows || !this.pose) return;
    this.placed = false;
    this.follow(null);
    this.redraw();
  }

  // From above, so far that all keyframes and the path are in view.
  top() {
    const box = new THREE.Box3();
    for (const keyframe of this.keyframes.values()) box.expandByPoint(this.centre(keyframe.pose));
    for (const point of this.path) box.expandByPoint(this.centre(point));
    if (box.isEmpty()) box.setFromCenterAndSize(new THREE.Vector3(), new THREE.Vector3(2, 0, 2));
    const centre = box.getCenter(new THREE.Vector3()), size = box.getSize(new THREE.Vector3());
    this.control.target.copy(centre);
    this.eye.position.set(centre.x, centre.y + 1.6 + 1.2 * Math.max(size.x / this.eye.aspect, size.z), centre.z + 0.001);
    this.control.update();
    this.redraw();
  }

  flashLoop(a, b) {
    const from = this.keyframes.get(a), to = this.keyframes.get(b);
    if (!from || !to) return;
    const [p, q] = [from, to].map((k) => new THREE.Vector3(k.pose[0], k.pose[1], k.pose[2]));
    const tube = new THREE.Mesh(new THREE.TubeBufferGeometry(new THREE.LineCurve3(p, q), 1, 0.02, 6),
                                new THREE.MeshBasicMaterial({color: COLOURS.loop, transparent: true}));
    this.world.add(tube);
    this.loops.push({tube, since: this.seconds()});
    this.redraw(LOOP_S);
  }

  // Drawing by the run's own processors gives way to it, but to a hand that turns the view at once.
  draw() {
    const now = this.seconds();
    if (this.sharesProcessors && !this.isHeld && now < this.drawnAt + SHARED_S) {
      this.hasDrawn = false;
      return;
    }
    if (this.hasDrawn) this.points.adapt(now - this.called);  // the browser calls late when drawing took long
    this.called = now;
    this.hasDrawn = false;
    const isMoving = this.dirty || now < this.drawUntil;
    if (isMoving) this.lastMove = now;
    if (!isMoving && (this.isWhole || now < this.lastMove + STILL_S)) return;
    this.isWhole = this.points.choose(!isMoving);
    this.hasDrawn = isMoving;
    this.dirty = false;
    this.points.material.uniforms.now.value = now;
    for (const loop of this.loops) {
      const age = (now - loop.since) / LOOP_S;
      loop.tube.material.opacity = age >= 1 ? 0.25 : 0.25 + 0.75 * Math.abs(Math.cos(3 * Math.PI * age));
    }
    this.renderer.render(this.scene, this.eye);
    this.drawnAt = now;
    this.drawn = (this.drawn || 0) + 1;
  }
}
