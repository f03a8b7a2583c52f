/* The 3D view: the organ and its instruments (instrument.js), with three.js. World frame of the mesh, metres.
 *
 * The organ's triangles are those of the bank, displaced by the field; the normals are recomputed for every frame. Colour
 * shows the length of the displacement, on a scale that the legend states. Without WebGL the constructor throws. */
'use strict';

/* Tissue at rest, then a path that grows lighter: still readable in grey and for colour-blind eyes. sRGB. */
const COLOURS = [[0, 0xa8483f], [0.2, 0xbf5b47], [0.45, 0xd97f49], [0.7, 0xeaac54], [1, 0xf8df86]];
const FIXED_COLOUR = 0x75879a;

/* sRGB 0..255 of the colour scale at s in 0..1. */
function scaleColour(s) {
  let k = 1;
  while (k < COLOURS.length - 1 && s > COLOURS[k][0]) k++;
  const [s0, c0] = COLOURS[k - 1], [s1, c1] = COLOURS[k];
  const a = channels(c0), b = channels(c1), t = Math.min(1, Math.max(0, (s - s0) / (s1 - s0)));
  return a.map((v, i) => v + t * (b[i] - v));
}

/* Triangles [i, j, k, outward normal] of the convex hull of a few points: those with all others on one side. Of points in a plane
 * both sides; of points in a line none. */
function hullFaces(P) {
  const faces = [];
  for (let i = 0; i < P.length; i++)
    for (let j = i + 1; j < P.length; j++)
      for (let k = j + 1; k < P.length; k++) {
        const out = P[j].clone().sub(P[i]).cross(P[k].clone().sub(P[i]));
        if (!(out.length() > 1e-12)) continue;
        out.normalize();
        const side = P.map((p) => p.clone().sub(P[i]).dot(out)), high = Math.max(...side), low = Math.min(...side);
        if (high < 1e-6) faces.push([i, j, k, out]);
        if (low > -1e-6) faces.push([i, j, k, out.clone().negate()]);
      }
  return faces;
}

class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({canvas, antialias: true, alpha: true});
    this.renderer.gammaOutput = true;
    this.renderer.gammaFactor = 2.2;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.005, 20);
    this.range_m = 0.005; // of the colour scale
    this.metresPerNewton = 0.02;
    this.ramp = new Float32Array(3 * 256);
    for (let i = 0; i < 256; i++) scaleColour(i / 255).forEach((v, k) => { this.ramp[3 * i + k] = linear(v / 255); });
  }

  /* Everything that does not move, from the hello. Called again after a reconnection: starts from nothing. */
  build(hello) {
    this.scene.traverse((object) => {
      if (object.geometry) object.geometry.dispose();
      if (object.material) object.material.dispose();
    });
    while (this.scene.children.length) this.scene.remove(this.scene.children[0]);

    this.hello = hello;
    this.buildOrgan(hello);
    this.buildObstacles(hello);
    this.instruments = hello.instruments.map((tool, i) => new Instrument(this.scene, tool, i, hello.jaws, 0.035 * this.sphere.radius));
    this.selected = this.instruments[0];
    this.axes = this.selected.axes;
    this.up = this.selected.out;
    this.home();
    this.buildLights();
  }

  buildOrgan(hello) {
    const geometry = new THREE.BufferGeometry();
    this.position = new THREE.BufferAttribute(new Float32Array(hello.rest), 3).setUsage(THREE.DynamicDrawUsage);
    this.colour = new THREE.BufferAttribute(new Float32Array(hello.rest.length), 3).setUsage(THREE.DynamicDrawUsage);
    geometry.setAttribute('position', this.position);
    geometry.setAttribute('color', this.colour);
    geometry.setIndex(new THREE.BufferAttribute(hello.index, 1));
    geometry.computeVertexNormals();
    geometry.computeBoundingSphere();
    this.sphere = geometry.boundingSphere.clone();
    this.sphere.radius *= 1.02;
    const material = new THREE.MeshStandardMaterial({vertexColors: THREE.VertexColors, roughness: 0.52, metalness: 0.0});
    this.organ = new THREE.Mesh(geometry, material);
    this.organ.frustumCulled = false;
    this.organ.castShadow = this.organ.receiveShadow = true;
    this.scene.add(this.organ);

    const wire = new THREE.MeshBasicMaterial({color: 0x2a1210, wireframe: true, transparent: true, opacity: 0.16, depthWrite: false});
    this.edges = new THREE.Mesh(geometry, wire);
    this.edges.frustumCulled = false;
    this.edges.visible = Boolean(this.showEdges);
    this.scene.add(this.edges);
    this.geometry = geometry;
    this.paint(new Float32Array(hello.rest.length));
  }

  /* What does not give way: hulls of a few points, swept by a sphere; and the cannulas. */
  buildObstacles(hello) {
    const bone = new THREE.MeshStandardMaterial({color: paintOf(0xdcd5c3), roughness: 0.7, metalness: 0, side: THREE.DoubleSide});
    const [outer, inside] = hello.cannula_m;
    for (const {radius_m, points} of hello.obstacles) {
      const group = new THREE.Group(), P = points.map((p) => new THREE.Vector3().fromArray(p)), faces = hullFaces(P);
      const vertices = faces.flatMap(([i, j, k, out]) => [i, j, k].flatMap((v) => P[v].clone().addScaledVector(out, radius_m).toArray()));
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(vertices), 3));
      geometry.computeVertexNormals();
      group.add(new THREE.Mesh(geometry, bone));
      const edges = faces.length ? faces.flatMap(([i, j, k]) => [[i, j], [j, k], [k, i]]) : P.map((_, i) => [Math.max(0, i - 1), i]);
      if (radius_m > 0) for (const edge of edges) sweep(group, edge.map((v) => ({at: P[v], radius: radius_m})), bone);
      group.traverse((object) => { object.castShadow = true; });
      this.scene.add(group);
    }
    if (!(outer > 0 && inside > 0)) return;
    const sleeve = new THREE.MeshStandardMaterial({color: paintOf(0x9fb4c4), roughness: 0.5, transparent: true, opacity: 0.6});
    for (const tool of hello.instruments) {
      const axis = new THREE.Vector3(tool.rotation[2], tool.rotation[5], tool.rotation[8]);
      const pipe = new THREE.Mesh(new THREE.CylinderBufferGeometry(outer, outer, inside, 32, 1, true), sleeve);
      pipe.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), axis);
      pipe.position.fromArray(tool.trocar_m).addScaledVector(axis, 0.5 * inside);
      this.scene.add(pipe);
    }
  }

  buildLights() {
    const {center, radius} = this.sphere;
    /* of the first view: up, to its right, towards its eye; lights stay when the camera moves */
    const right = new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0), towards = right.clone().cross(this.up);
    const at = (a, b, c) => center.clone().addScaledVector(this.up, a * radius).addScaledVector(right, b * radius).addScaledVector(towards, c * radius);
    const sky = new THREE.HemisphereLight(0xffffff, 0xb9a49c, 0.56);
    sky.position.copy(this.up);
    const key = new THREE.DirectionalLight(0xfff6ec, 0.66);
    key.position.copy(at(3, -1.7, 0.9));
    key.target.position.copy(center);
    key.castShadow = true;
    key.shadow.mapSize.set(1024, 1024);
    key.shadow.radius = 4;
    key.shadow.bias = -0.0015;
    const box = key.shadow.camera;
    box.left = box.bottom = -1.7 * radius;
    box.right = box.top = 1.7 * radius;
    box.near = 0.2 * radius;
    box.far = 8 * radius;
    const fill = new THREE.DirectionalLight(0xdfeaf5, 0.22);
    fill.position.copy(at(0.5, 2.2, 2));
    fill.target.position.copy(center);
    this.scene.add(sky, key, key.target, fill, fill.target);

    /* The table: only its shadow is seen. Just under the lowest point of the body at rest. */
    let lowest = Infinity;
    const point = new THREE.Vector3(), rest = this.hello.rest;
    for (let i = 0; i < rest.length; i += 3) lowest = Math.min(lowest, point.fromArray(rest, i).sub(center).dot(this.up));
    const table = new THREE.Mesh(new THREE.PlaneBufferGeometry(14 * radius, 14 * radius), new THREE.ShadowMaterial({opacity: 0.17}));
    table.position.copy(center).addScaledVector(this.up, lowest - 0.02 * radius);
    table.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), this.up);
    table.receiveShadow = true;
    this.scene.add(table);
  }

  /* The body's long axis across the picture, from above and from the side away from where it is held. */
  home() {
    if (!this.hello) return;
    this.resize();
    const {center, radius} = this.sphere, rest = this.hello.rest, point = new THREE.Vector3();
    let xx = 0, xy = 0, yy = 0;
    for (let i = 0; i < rest.length; i += 3) {
      point.fromArray(rest, i).sub(center);
      const x = point.dot(this.axes[0]), y = point.dot(this.axes[1]);
      xx += x * x; xy += x * y; yy += y * y;
    }
    const angle = 0.5 * Math.atan2(2 * xy, xx - yy) - 0.3; // of the long axis, turned a little for depth
    const view = new THREE.Vector3().addScaledVector(this.axes[0], Math.sin(angle)).addScaledVector(this.axes[1], -Math.cos(angle));
    const held = new THREE.Vector3();
    this.hello.fixedFlags.forEach((flag, v) => { if (flag) held.add(point.fromArray(rest, 3 * v).sub(center)); });
    if (held.dot(view) > 0) view.negate();
    const sight = view.multiplyScalar(0.78).addScaledVector(this.up, 0.62).normalize(); // from the target to the eye
    const right = this.up.clone().cross(sight).normalize(), above = sight.clone().cross(right);

    /* The nearest distance from which the body and the trocars fit; the middle of the picture is the middle of both. */
    const corners = this.instruments.map((instrument) => instrument.trocar.clone().addScaledVector(this.up, 0.02));
    for (let i = 0; i < rest.length; i += 3) corners.push(new THREE.Vector3().fromArray(rest, i));
    const middle = (axis) => {
      const along = corners.map((corner) => corner.dot(axis));
      return 0.5 * (along.reduce((a, b) => Math.min(a, b)) + along.reduce((a, b) => Math.max(a, b)));
    };
    const target = center.clone();
    for (const axis of [right, above]) target.addScaledVector(axis, middle(axis) - target.dot(axis));
    const slope = Math.tan(THREE.Math.degToRad(0.5 * this.camera.fov)) / 1.08;
    let distance = radius;
    for (const corner of corners) {
      corner.sub(target);
      const across = Math.max(Math.abs(corner.dot(right)) / Math.max(0.2, this.camera.aspect), Math.abs(corner.dot(above)));
      distance = Math.max(distance, corner.dot(sight) + across / slope);
    }
    this.camera.up.copy(this.up);
    this.camera.position.copy(target).addScaledVector(sight, distance);
    this.camera.near = 0.05 * distance;
    this.camera.far = 8 * distance;
    if (this.controls) this.controls.dispose();
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.enableKeys = false; // the keys move the hand
    this.controls.minDistance = 0.3 * radius;
    this.controls.maxDistance = 12 * radius;
    this.controls.target.copy(target);
    this.controls.addEventListener('change', () => { this.dirty = true; });
    this.controls.update();
    this.camera.updateMatrixWorld();
    this.dirty = true;
  }

  resize() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  setEdges(visible) {
    this.showEdges = visible;
    if (this.edges) this.edges.visible = visible;
    this.dirty = true;
  }

  paint(u) {
    const colour = this.colour.array, fixed = this.hello.fixedFlags, held = channels(FIXED_COLOUR).map((v) => linear(v / 255));
    for (let v = 0, i = 0; v < fixed.length; v++, i += 3) {
      if (fixed[v]) {
        colour[i] = held[0]; colour[i + 1] = held[1]; colour[i + 2] = held[2];
        continue;
      }
      const length = Math.hypot(u[i], u[i + 1], u[i + 2]);
      const k = 3 * Math.min(255, Math.round(255 * length / this.range_m));
      colour[i] = this.ramp[k]; colour[i + 1] = this.ramp[k + 1]; colour[i + 2] = this.ramp[k + 2];
    }
    this.colour.needsUpdate = true;
  }

  update(frame) {
    const position = this.position.array, rest = this.hello.rest, u = frame.u;
    for (let i = 0; i < rest.length; i++) position[i] = rest[i] + u[i];
    this.position.needsUpdate = true;
    this.geometry.computeVertexNormals();
    this.paint(u);
    this.instruments.forEach((instrument, i) => instrument.update(frame.instruments[i], this.metresPerNewton));
    this.dirty = true;
  }

  /* Where an instrument's arrow ends on the canvas, in CSS pixels; null when there is no arrow. */
  arrowOnScreen(number) {
    const instrument = this.instruments && this.instruments[number];
    if (!instrument || !instrument.arrow.visible) return null;
    const p = instrument.arrowEnd.clone().project(this.camera);
    return {x: 0.5 * (1 + p.x) * this.canvas.clientWidth, y: 0.5 * (1 - p.y) * this.canvas.clientHeight};
  }

  /* Whose hand the keys and the mouse move. */
  select(number) {
    if (this.instruments) this.selected = this.instruments[number];
  }

  /* A step on the screen (right, up; metres at the tip) as a step of the selected hand in its trocar's frame, across the shaft. */
  across(right, up) {
    const e = this.camera.matrixWorld.elements;
    const local = (x, y, z) => this.selected.axes.slice(0, 2).map((axis) => axis.x * x + axis.y * y + axis.z * z);
    const unit = (v) => { const n = Math.hypot(v[0], v[1]) || 1; return [v[0] / n, v[1] / n]; };
    const r = unit(local(e[0], e[1], e[2]));
    /* seen from above, up on the screen is the camera's up; from the side, away from the camera */
    const f = unit(local(e[4] - e[8], e[5] - e[9], e[6] - e[10]));
    return [right * r[0] + up * f[0], right * r[1] + up * f[1]];
  }

  /* Metres at the tip per CSS pixel. */
  metresPerPixel() {
    const distance = this.camera.position.distanceTo(this.selected.tip);
    return 2 * distance * Math.tan(THREE.Math.degToRad(0.5 * this.camera.fov)) / Math.max(1, this.canvas.clientHeight);
  }

  render() {
    if (!this.dirty || !this.hello) return false;
    this.dirty = false;
    this.renderer.render(this.scene, this.camera);
    return true;
  }
}
