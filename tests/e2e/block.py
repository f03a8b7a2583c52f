"""A body for tests: a block of tetrahedra, and a scene that holds it at its bottom."""

SCENE = """scene: block
body:
  mesh: {file: block.msh, unit: m}
  materials: [{label: all, E: 4 kPa, nu: 0.45, rho: 1060 kg/m3}]
  fixed:
    - {plane: {at: [0, 0, 0], normal: [0, 0, -1]}}
"""


def write_block(path, n=(5, 4, 3), size=(0.12, 0.10, 0.06)):
    """A block of tetrahedra, six to a cell around its diagonal, as Gmsh 2.2 ASCII."""
    number = lambda i, j, k: 1 + i + (n[0] + 1) * (j + (n[1] + 1) * k)
    nodes = [(number(i, j, k), size[0] * i / n[0], size[1] * j / n[1], size[2] * k / n[2])
             for k in range(n[2] + 1) for j in range(n[1] + 1) for i in range(n[0] + 1)]
    tets = []
    for i in range(n[0]):
        for j in range(n[1]):
            for k in range(n[2]):
                for a, b in ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)):
                    corner = [[i, j, k]]
                    for axis in (a, b, 3 - a - b):
                        corner.append(corner[-1][:])
                        corner[-1][axis] += 1
                    tets.append([number(*c) for c in corner])
    with open(path, "w") as out:
        out.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n%d\n" % len(nodes))
        out.writelines("%d %r %r %r\n" % node for node in nodes)
        out.write("$EndNodes\n$Elements\n%d\n" % len(tets))
        out.writelines("%d 4 2 1 1 %d %d %d %d\n" % (e + 1, *t) for e, t in enumerate(tets))
        out.write("$EndElements\n")
