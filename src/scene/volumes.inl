// volumes.inl: one row per field over space: VOLUME(ENUM, prefix, "xml name"). The header provides prefix_eval and
// prefix_adj, of a point in the volume's own space.
VOLUME(CONSTANT, constvolume, "constvolume")
VOLUME(GRID, gridvolume, "gridvolume")
