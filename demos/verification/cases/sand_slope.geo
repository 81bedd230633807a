// A slope of 21.8 degrees and height 1 on firm ground.
Point(1) = {0, -1, 0}; Point(2) = {3.7, -1, 0}; Point(3) = {1.2, 0, 0}; Point(4) = {0, 0, 0};
For k In {1:4}
  Line(k) = {k, k % 4 + 1};
EndFor
Curve Loop(1) = {1:4}; Plane Surface(1) = {1};
Physical Surface("soil") = {1};
