// The section of a hollow shaft in a hub (mm).
SetFactory("OpenCASCADE");
Disk(1) = {0, 0, 0, 20};
Disk(2) = {0, 0, 0, 8};
Disk(3) = {0, 0, 0, 40};
Disk(4) = {0, 0, 0, 20};
BooleanDifference(5) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
BooleanDifference(6) = { Surface{3}; Delete; }{ Surface{4}; Delete; };
Physical Surface("shaft") = {5};
Physical Surface("hub") = {6};
