// A cylindrical vessel with a nozzle (mm): the part between four cutting planes.
SetFactory("OpenCASCADE");
Cylinder(1) = {-150, 0, 0, 300, 0, 0, 110};
Cylinder(2) = {0, 0, 0, 0, 0, 170, 35};
BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Cylinder(4) = {-150, 0, 0, 300, 0, 0, 100};
Cylinder(5) = {0, 0, 0, 0, 0, 170, 29};
BooleanUnion(6) = { Volume{4}; Delete; }{ Volume{5}; Delete; };
BooleanDifference(7) = { Volume{3}; Delete; }{ Volume{6}; Delete; };
Box(8) = {-200, -200, 0, 400, 400, 200};
BooleanIntersection(9) = { Volume{7}; Delete; }{ Volume{8}; Delete; };
Physical Volume("vessel") = {9};
