// kinds.inl: one row per kind of surface. From the row come the enum, dispatch, the plugin's attributes with their
// defaults, derived tables, and the ray tracer's callbacks.
//   SHAPE_MESH_KIND(ENUM, prefix)                             triangles in the world
//   SHAPE_POSED(ENUM, prefix, GEOMETRY, "plugin", PARAMS)     one surface that follows to_world. PARAMS are folded into it.
//   SHAPE_CURVE(ENUM, prefix, GEOMETRY, "plugin")             tubes along control points in the world
// GEOMETRY: SPHERE_POINT is Embree's own, as those of curves are; USER needs prefix_bounds and prefix_meet.
SHAPE_MESH_KIND(MESH, mesh)
SHAPE_POSED(SPHERE, sphere, SPHERE_POINT, "sphere", SPHERE_PARAMS)
SHAPE_POSED(DISK, disk, USER, "disk", NO_SHAPE_PARAMS)
SHAPE_POSED(CYLINDER, cylinder, USER, "cylinder", CYLINDER_PARAMS)
SHAPE_POSED(SDFGRID, sdfgrid, USER, "sdfgrid", NO_SHAPE_PARAMS)
SHAPE_CURVE(BSPLINE, bspline, ROUND_BSPLINE_CURVE, "bsplinecurve")
SHAPE_CURVE(LINEAR, linear, ROUND_LINEAR_CURVE, "linearcurve")
