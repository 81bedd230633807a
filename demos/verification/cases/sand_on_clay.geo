// An embankment of sand, 3 m high and 1:2, on 4 m of clay (m).
Point(1) = {-12, -4, 0}; Point(2) = {12, -4, 0}; Point(3) = {12, 0, 0}; Point(4) = {12, 3, 0};
Point(5) = {6, 3, 0}; Point(6) = {0, 0, 0}; Point(7) = {-12, 0, 0};
For k In {1:7}
  Line(k) = {k, k % 7 + 1};
EndFor
Line(8) = {3, 6};
Curve Loop(1) = {1, 2, 8, 6, 7}; Plane Surface(1) = {1};
Curve Loop(2) = {3, 4, 5, -8}; Plane Surface(2) = {2};
Physical Surface("clay") = {1}; Physical Surface("sand") = {2};
