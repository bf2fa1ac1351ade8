// kinds.inl: one row per sensor: SENSOR(ENUM, prefix, "xml name"). The header provides prefix_ray: the ray of a position
// on the full film [pixels] and of a pair of random numbers, on the aperture for instance.
SENSOR(PERSPECTIVE, perspective, "perspective")
SENSOR(THINLENS, thinlens, "thinlens")
SENSOR(ORTHOGRAPHIC, orthographic, "orthographic")
SENSOR(RADIANCEMETER, radiancemeter, "radiancemeter")
SENSOR(IRRADIANCEMETER, irradiancemeter, "irradiancemeter")
SENSOR(DISTANT, distant, "distant")
