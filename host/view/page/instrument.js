/* One instrument in the 3D view: shaft through its trocar, tip or jaws, contacts, held points, and the force on it. */
'use strict';

/* Of the first and the second instrument: force, and ring of the trocar. Also in style.css. */
const FORCE_COLOURS = [0xc2410c, 0x6d28d9];
const RING_COLOURS = [0x2f86b8, 0x7a5bbf];
const JAWS_OPEN = 0.42; // rad, each

const linear = (c) => (c <= 0.04045 ? c / 12.92 : Math.pow((c + 0.055) / 1.055, 2.4));
const paintOf = (hex) => new THREE.Color(hex).convertSRGBToLinear();
const channels = (hex) => [hex >> 16 & 255, hex >> 8 & 255, hex & 255];

/* Spheres and what lies between each and the next, in a group. */
function sweep(group, spheres, material) {
  spheres.forEach(({at, radius}, i) => {
    const ball = new THREE.Mesh(new THREE.SphereBufferGeometry(radius, 24, 16), material);
    ball.position.copy(at);
    group.add(ball);
    if (!i) return;
    const before = spheres[i - 1], way = at.clone().sub(before.at), length = way.length();
    if (!(length > 1e-6)) return;
    const between = new THREE.Mesh(new THREE.CylinderBufferGeometry(radius, before.radius, length, 24, 1, true), material);
    between.position.copy(before.at).addScaledVector(way, 0.5);
    between.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), way.divideScalar(length));
    group.add(between);
  });
}

class Instrument {
  /* `tool`: of the hello; `number` from 0; `mark_m`: the least size of what is no part of it, that it can be seen. */
  constructor(scene, tool, number, jaws, mark_m) {
    const column = (k) => new THREE.Vector3(tool.rotation[k], tool.rotation[3 + k], tool.rotation[6 + k]);
    this.axes = [column(0), column(1), column(2)];
    this.out = this.axes[2].clone().negate(); // of the body
    this.trocar = new THREE.Vector3().fromArray(tool.trocar_m);
    this.radius = tool.tip_radius_m;
    this.mark = Math.max(mark_m, this.radius, ...tool.spheres.map((sphere) => sphere[3]));
    this.tip = this.trocar.clone();
    this.group = new THREE.Group();
    this.spheres = tool.spheres.map(([x, y, z, radius, along, side]) => ({at: new THREE.Vector3(x, y, z), radius, along, side}));
    this.opening = this.spheres.length ? tool.opening_rad : JAWS_OPEN;
    this.buildShaft(number, jaws);
    this.dots = this.buildDots(0.24, 0x10222e, 2);
    this.holds = this.buildDots(0.34, 0x1fd9c8, 3);
    this.buildForce(FORCE_COLOURS[number % FORCE_COLOURS.length]);
    this.group.visible = false;
    scene.add(this.group);
  }

  buildShaft(number, jaws) {
    const radius = this.radius;
    const steel = new THREE.MeshStandardMaterial({color: paintOf(0xc9d0d6), roughness: 0.32, metalness: 0.12});
    const dark = new THREE.MeshStandardMaterial({color: paintOf(0x46535e), roughness: 0.55, metalness: 0.1});
    this.shaft = new THREE.Mesh(new THREE.CylinderBufferGeometry(0.45 * radius, 0.45 * radius, 1, 32), steel);
    this.grip = new THREE.Mesh(new THREE.CylinderBufferGeometry(1.5 * this.mark, 1.1 * this.mark, 1, 32), dark);
    this.ring = new THREE.Mesh(new THREE.TorusBufferGeometry(1.9 * this.mark, 0.5 * this.mark, 20, 56),
      new THREE.MeshStandardMaterial({color: paintOf(RING_COLOURS[number % RING_COLOURS.length]), roughness: 0.45, metalness: 0.1}));
    this.ring.position.copy(this.trocar);
    this.ring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), this.out);
    this.head = new THREE.Group(); // its Y is out along the shaft
    this.jaws = [];
    this.body = new THREE.Group(); // the instrument's own frame: X, Y, and Z along the shaft
    if (this.spheres.length) this.buildShape(steel);
    else if (jaws) this.buildJaws(steel, dark);
    else this.head.add(new THREE.Mesh(new THREE.SphereBufferGeometry(radius, 40, 28), steel));
    for (const part of [this.shaft, this.grip, this.ring, this.head, this.body]) {
      part.traverse((object) => { object.castShadow = true; });
      this.group.add(part);
    }
  }

  /* The swept spheres that the controller has of it. */
  buildShape(steel) {
    const rod = this.spheres.filter((s) => !s.side).sort((a, b) => a.at.z - b.at.z);
    sweep(this.body, rod, steel);
    if (rod.length) {
      this.hinge = -rod[0].at.z;
      this.shaft.scale.x = this.shaft.scale.z = rod[0].radius / (0.45 * this.radius);
    }
    for (const side of [1, -1]) {
      const of = this.spheres.filter((s) => s.side === side).sort((a, b) => a.along - b.along);
      if (!of.length) continue;
      const jaw = new THREE.Group();
      jaw.position.copy(of[0].at);
      jaw.userData.side = side;
      sweep(jaw, [{at: new THREE.Vector3(), radius: of[0].radius},
        ...of.map(({along, radius}) => ({at: new THREE.Vector3(0, 0, along), radius}))], steel);
      this.jaws.push(jaw);
      this.body.add(jaw);
    }
  }

  /* Two halves of a slender ellipsoid with teeth between, hinged behind the tip; closed they end where the tip's sphere does. */
  buildJaws(steel, dark) {
    const radius = this.radius, length = 4.2 * radius;
    this.hinge = length - radius;
    const pin = new THREE.Mesh(new THREE.CylinderBufferGeometry(0.3 * radius, 0.3 * radius, 1.5 * radius, 24), dark);
    pin.rotation.x = Math.PI / 2;
    pin.position.y = this.hinge;
    const yoke = new THREE.Mesh(new THREE.SphereBufferGeometry(0.62 * radius, 28, 20), steel);
    yoke.position.y = this.hinge;
    this.head.add(pin, yoke);
    for (const side of [1, -1]) {
      const jaw = new THREE.Group();
      const half = new THREE.Mesh(new THREE.SphereBufferGeometry(1, 32, 24, side > 0 ? Math.PI / 2 : -Math.PI / 2, Math.PI), steel);
      half.scale.set(0.62 * radius, 0.5 * length, 0.55 * radius);
      half.position.y = -0.5 * length;
      const face = new THREE.Mesh(new THREE.CircleBufferGeometry(1, 32), dark);
      face.rotation.y = side > 0 ? -Math.PI / 2 : Math.PI / 2;
      face.scale.set(0.55 * radius, 0.5 * length, 1);
      face.position.set(0.001 * radius * side, -0.5 * length, 0);
      jaw.add(half, face);
      jaw.position.y = this.hinge;
      jaw.userData.side = side;
      this.jaws.push(jaw);
      this.head.add(jaw);
    }
  }

  buildDots(size, colour, order) {
    const dot = new THREE.SphereBufferGeometry(size * this.mark, 16, 12), dots = [];
    for (let i = 0; i < 16; i++) {
      const mesh = new THREE.Mesh(dot, new THREE.MeshBasicMaterial({color: colour, depthTest: false, transparent: true, opacity: 0.85}));
      mesh.visible = false;
      mesh.renderOrder = order;
      dots.push(mesh);
      this.group.add(mesh);
    }
    return dots;
  }

  buildForce(colour) {
    const paint = new THREE.MeshStandardMaterial({color: paintOf(colour), emissive: paintOf(colour), emissiveIntensity: 0.35, roughness: 0.6});
    const ghost = new THREE.MeshBasicMaterial({color: colour, depthTest: false, depthWrite: false, transparent: true, opacity: 0.7});
    const stem = new THREE.CylinderBufferGeometry(0.5 * this.mark, 0.5 * this.mark, 1, 32);
    const head = new THREE.ConeBufferGeometry(1.4 * this.mark, 3.4 * this.mark, 40);
    this.arrow = new THREE.Group();
    this.arrowParts = [paint, ghost].map((material) => {
      const parts = {stem: new THREE.Mesh(stem, material), head: new THREE.Mesh(head, material)};
      this.arrow.add(parts.stem, parts.head);
      return parts;
    });
    for (const part of Object.values(this.arrowParts[1])) part.renderOrder = 1; // seen through the organ when it points into it
    this.arrow.visible = false;
    this.group.add(this.arrow);
  }

  /* `state`: of the frame; null when it is not there. */
  update(state, metresPerNewton) {
    this.group.visible = Boolean(state);
    this.arrow.visible = false;
    if (!state) return;
    this.tip.fromArray(state.tip_m);
    this.move(state.grip, state.roll_rad);
    const place = (dots, points) => dots.forEach((dot, i) => {
      dot.visible = i < points.length;
      if (dot.visible) dot.position.fromArray(points[i]);
    });
    place(this.dots, state.contacts);
    place(this.holds, state.held);
    this.moveForce(new THREE.Vector3().fromArray(state.force_N), metresPerNewton);
  }

  move(grip, roll) {
    const Y = new THREE.Vector3(0, 1, 0), axis = this.tip.clone().sub(this.trocar);
    const inside = axis.length();
    if (!(inside > 1e-6)) return;
    axis.divideScalar(inside);
    const outside = 0.045, handle = 0.032, end = inside - (this.hinge || 0);
    const along = (part, from, length) => {
      part.quaternion.setFromUnitVectors(Y, axis.clone().negate());
      part.position.copy(this.trocar).addScaledVector(axis, from + 0.5 * length);
      part.scale.y = length;
    };
    along(this.shaft, -outside, end + outside);
    along(this.grip, -outside - handle, handle);
    this.head.position.copy(this.tip);
    this.head.quaternion.setFromUnitVectors(Y, axis.clone().negate());
    /* the trocar's X made square to the shaft, turned by the roll */
    const X = this.axes[0].clone().addScaledVector(axis, -this.axes[0].dot(axis)).normalize(), frame = new THREE.Matrix4();
    frame.makeBasis(X, axis.clone().cross(X), axis);
    this.body.position.copy(this.tip);
    this.body.quaternion.setFromRotationMatrix(frame).multiply(new THREE.Quaternion().setFromAxisAngle(new THREE.Vector3(0, 0, 1), roll));
    const turned = this.spheres.length ? 'y' : 'z';
    for (const jaw of this.jaws) jaw.rotation[turned] = jaw.userData.side * this.opening * (1 - grip);
  }

  /* From the tip, in the direction in which the tissue pushes the tool. */
  moveForce(force, metresPerNewton) {
    const newtons = force.length();
    this.arrow.visible = newtons > 0.02;
    if (!this.arrow.visible) return;
    const head = 3.4 * this.mark, length = Math.max(head * 1.05, newtons * metresPerNewton);
    this.arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), force.clone().divideScalar(newtons));
    this.arrow.position.copy(this.tip);
    for (const part of Object.values(this.arrowParts[1])) part.visible = force.dot(this.out) < 0;
    for (const parts of this.arrowParts) {
      parts.stem.scale.y = length - head;
      parts.stem.position.y = 0.5 * (length - head);
      parts.head.position.y = length - 0.5 * head;
    }
    this.arrowEnd = this.tip.clone().addScaledVector(force, length / newtons);
  }
}
