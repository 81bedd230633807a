// Half a dovetail joint (mm): the root of a blade in the groove of a disc.
SetFactory("OpenCASCADE");
Point(1) = {-6, 12, 0};
Point(2) = {6, 12, 0};
Point(3) = {6, 0, 0};
Point(4) = {14, -10, 0};
Point(5) = {14, -16, 0};
Point(6) = {-14, -16, 0};
Point(7) = {-14, -10, 0};
Point(8) = {-6, 0, 0};
For k In {1:8}
  Line(k) = {k, k % 8 + 1};
EndFor
Curve Loop(1) = {1:8};
Plane Surface(1) = {1};
Rectangle(2) = {-30, -40, 0, 60, 40};
BooleanDifference(3) = { Surface{2}; Delete; }{ Surface{1}; };
Physical Surface("blade") = {1};
Physical Surface("disc") = {3};
