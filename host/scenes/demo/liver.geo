// The demo's organ: a liver-like body, lofted through cross-sections from the right lobe (x < 0, thick) to the left one
// (x > 0, thin and drooping), with the crease of the falciform ligament between. Lengths in metres; y to the back, z up.
SetFactory("OpenCASCADE");

size = 0.0142;       // edge length: about 430 surface nodes
half_length = 0.105; // of 0.21 m from end to end
sections = 13;

// Control points of a section in units of its depth (y, front to back) and thickness (z, from below): the dome under the
// diaphragm, from the sharp front edge over the top to the back edge; then back again under the hollow visceral face.
dome_y() = {-1.00, -1.12, -1.02, -0.62, 0.00, 0.62, 1.00, 1.10, 0.92};
dome_z() = { 0.00,  0.32,  0.72,  1.02, 1.08, 1.00, 0.72, 0.38, 0.18};
face_y() = { 0.50,  0.05, -0.50};
face_z() = { 0.26,  0.30,  0.18};

wires() = {};
For i In {0:sections-1}
  u = -Cos(Pi * (i + 0.4) / (sections - 0.2)); // -1..1, closer together at the ends, which stay open by a small flat
  left = u > 0 ? u : 0;
  end = u > 0 ? Sqrt(1 - u^3) : Sqrt(1 - u^2); // rounds the ends off, the left one more bluntly
  crease = Exp(-((u - 0.15) / 0.16)^2);
  thick = end * (0.088 - 0.046 * u - 0.010 * crease) * (1 - 0.30 * left);
  depth = end * (0.060 - 0.020 * u - 0.005 * crease);
  back = 0.012 * u;
  middle = 0.012 * u - 0.022 * left^2;

  p = newp;
  For k In {0:8}
    Point(p + k) = {half_length * u, back + depth * dome_y(k), middle + thick * (dome_z(k) - 0.5)};
  EndFor
  For k In {0:2}
    Point(p + 9 + k) = {half_length * u, back + depth * face_y(k), middle + thick * (face_z(k) - 0.5)};
  EndFor
  c = newl;
  BSpline(c) = {p:p+8};
  BSpline(c + 1) = {p+8:p+11, p};
  w = newll;
  Wire(w) = {c, c + 1};
  wires() += {w};
EndFor
ThruSections(1) = {wires()};

Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.MeshSizeExtendFromBoundary = 0; // the small flats at the ends must not refine the rest
Mesh.MinimumCurvePoints = 2;
Mesh.Optimize = 1;
