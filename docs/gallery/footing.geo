// A strip footing of concrete (m) beside a slope of 1:2 and 6 m, 2 m from its crest.
SetFactory("OpenCASCADE");
Point(1) = {-16, 0, 0};
Point(2) = {18, 0, 0};
Point(3) = {18, 4, 0};
Point(4) = {12, 4, 0};
Point(5) = {0, 10, 0};
Point(6) = {-2, 10, 0};
Point(7) = {-4, 10, 0};
Point(8) = {-16, 10, 0};
Point(9) = {-2, 10.8, 0};
Point(10) = {-4, 10.8, 0};
For k In {1:8}
  Line(k) = {k, k % 8 + 1};
EndFor
Line(9) = {6, 9};
Line(10) = {9, 10};
Line(11) = {10, 7};
Curve Loop(1) = {1:8};
Plane Surface(1) = {1};
Curve Loop(2) = {9, 10, 11, -6};
Plane Surface(2) = {2};
Physical Surface("ground") = {1};
Physical Surface("footing") = {2};
