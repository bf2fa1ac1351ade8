"""Large grids, written row by row: two balls of fog in the unit cube, dense in a VOL file and sparse in a NanoVDB file. The
field is the same whichever way the axes are exchanged, so that rows along x are lines along z."""
import array
import struct

CENTRES, RADII = (0.25, 0.75), (0.24, 0.16)
LEVELS = 1024  # distances from the axis of a row that are told apart


def lines(side):
    """line(u, v): the voxels along the third axis, as bytes, or None where all are 0."""
    made = {}

    def make(ball, level):
        far = level / LEVELS
        numbers = ((1 - far - (((i + 0.5) / side - CENTRES[ball]) / RADII[ball]) ** 2) for i in range(side))
        return array.array("f", (max(0.0, n) for n in numbers)).tobytes()

    def line(u, v):
        ball = int(2 * u >= side)
        if int(2 * v >= side) != ball:
            return None
        level = int(LEVELS * sum((((w + 0.5) / side - CENTRES[ball]) / RADII[ball]) ** 2 for w in (u, v)) + 0.5)
        if level >= LEVELS:
            return None
        if (ball, level) not in made:
            made[ball, level] = make(ball, level)
        return made[ball, level]

    return line


def write_vol(path, side):
    line, empty = lines(side), bytes(4 * side)
    with open(path, "wb") as f:
        f.write(b"VOL\3" + struct.pack("<5i6f", 1, side, side, side, 1, 0, 0, 0, 1, 1, 1))
        for z in range(side):
            f.write(b"".join(line(y, z) or empty for y in range(side)))


def leaves(side):
    """Those with voxels that are not 0: yields (x, y, z) of their first voxel and the 512 voxels, z fastest."""
    line, none = lines(side), bytes(32)
    for x in range(0, side, 8):
        for y in range(0, side, 8):
            rows = [line(x + k // 8, y + k % 8) for k in range(64)]
            for z in range(0, side, 8) if any(rows) else ():
                voxels = b"".join(row[4 * z:4 * z + 32] if row else none for row in rows)
                if any(voxels):
                    yield (x, y, z), voxels


def write_nvdb(path, side):
    """One grid of floats, at most 4096 voxels along each axis: a root, an upper node, lower nodes of 128^3 voxels, leaves."""
    lower_size, upper_size, root_size, leaf_size = 1088 + 8 * 4096, 8256 + 8 * 32768, 64 + 32, 96 + 4 * 512
    nodes = {}  # number in the upper node: leaves in the lower one
    for (x, y, z), voxels in leaves(side):
        number = ((x >> 7) << 10) | ((y >> 7) << 5) | z >> 7
        nodes.setdefault(number, []).append((((x >> 3 & 15) << 8) | ((y >> 3 & 15) << 4) | z >> 3 & 15, voxels))
    upper, mask = bytearray(upper_size), 0
    at = upper_size  # from the upper node
    for number, inside in sorted(nodes.items()):
        mask |= 1 << number
        struct.pack_into("<q", upper, 8256 + 8 * number, at)
        at += lower_size + leaf_size * len(inside)
    upper[4128:4128 + 4096] = mask.to_bytes(4096, "little")
    grid = bytearray(672 + 64 + root_size)
    grid[:8] = b"NanoVDB0"
    for k in range(3):
        struct.pack_into("<d", grid, 296 + 88 + 32 * k, 1 / side)
        struct.pack_into("<d", grid, 296 + 232 + 8 * k, 0.5 / side)
    struct.pack_into("<I", grid, 636, 1)  # floats
    struct.pack_into("<Q", grid, 672 + 24, 64)
    struct.pack_into("<6iIf", grid, 736, 0, 0, 0, side - 1, side - 1, side - 1, 1, 0)
    struct.pack_into("<Qq", grid, 736 + 64, 0, root_size)
    record = bytearray(176)
    struct.pack_into("<QQ", record, 0, len(grid) + at, len(grid) + at)
    struct.pack_into("<I", record, 136, 2)
    with open(path, "wb") as f:
        f.write(b"NanoVDB0" + struct.pack("<IHH", 32 << 21 | 3 << 10, 1, 0) + record + b"d\0" + grid + upper)
        for number, inside in sorted(nodes.items()):
            lower, mask = bytearray(lower_size), 0
            for k, (n, voxels) in enumerate(inside):
                mask |= 1 << n
                struct.pack_into("<q", lower, 1088 + 8 * n, lower_size + leaf_size * k)
            lower[544:544 + 512] = mask.to_bytes(512, "little")
            f.write(lower + b"".join(bytes(96) + voxels for n, voxels in inside))
