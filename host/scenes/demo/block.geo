// A block of two layers, for scenes with materials by label. Lengths in metres; z up.
SetFactory("OpenCASCADE");
size = 0.015;
Box(1) = {0, 0, 0.00, 0.16, 0.10, 0.03};
Box(2) = {0, 0, 0.03, 0.16, 0.10, 0.02};
BooleanFragments{ Volume{1}; Delete; }{ Volume{2}; Delete; } // the layers share the nodes between them
Physical Volume("muscle") = {1};
Physical Volume("fat") = {2};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
