"""Fabrics and their tests: materials, measured fabrics of a user's file, specimens.

| module | what lies there |
| --- | --- |
| fabric | density and flexural rigidity of a fabric; those of the suite |
| measured | a user's file of measured fabrics |
| gauge | fabrics of a user's copy of GAUGE |
| elastica | exact shape of a strip under its weight; bending length from its angle |
| strip | clamped strip: cantilever of ASTM D1388 |
| disc | specimen of Cusick's drapemeter and its drape coefficient |
"""
