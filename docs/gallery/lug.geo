// A complete lug with its pin (mm); the case models a quarter by symmetry.
SetFactory("OpenCASCADE");
Box(1) = {-20, -60, -5, 40, 60, 10};
Cylinder(2) = {0, 0, -5, 0, 0, 10, 20};
Cylinder(3) = {0, 0, -5, 0, 0, 10, 10};
BooleanUnion(4) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
BooleanDifference(5) = { Volume{4}; Delete; }{ Volume{3}; Delete; };
Cylinder(6) = {0, 0, -8, 0, 0, 16, 10};
Physical Volume("lug") = {5};
Physical Volume("pin") = {6};
