// A strip footing on clay beside a slope of 1:2 (m); its edge is 2 m from the crest.
Point(1) = {-12, 0, 0};
Point(2) = {14, 0, 0};
Point(3) = {14, 6, 0};
Point(4) = {10, 6, 0};
Point(5) = {2, 10, 0};
Point(6) = {0, 10, 0};
Point(7) = {-2, 10, 0};
Point(8) = {-12, 10, 0};
For k In {1:8}
  Line(k) = {k, k % 8 + 1};
EndFor
Curve Loop(1) = {1:8};
Plane Surface(1) = {1};
Physical Surface("clay") = {1};
