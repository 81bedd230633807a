// A gravity wall (m) that is founded on ground and retains 4 m of ground.
SetFactory("OpenCASCADE");
Point(1) = {-8, -5, 0};
Point(2) = {10, -5, 0};
Point(3) = {10, 4, 0};
Point(4) = {0, 4, 0};
Point(5) = {0, 0, 0};
Point(6) = {-8, 0, 0};
Point(7) = {-2.2, 0, 0};
Point(8) = {-0.8, 4, 0};
For k In {1:5}
  Line(k) = {k, k + 1};
EndFor
Line(6) = {6, 1};
Line(7) = {5, 7};
Line(8) = {7, 6};
Line(9) = {7, 8};
Line(10) = {8, 4};
Curve Loop(1) = {1, 2, 3, 4, 7, 8, 6};
Plane Surface(1) = {1};
Curve Loop(2) = {-7, -4, -10, -9};
Plane Surface(2) = {2};
Physical Surface("ground") = {1};
Physical Surface("wall") = {2};
