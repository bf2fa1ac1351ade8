// kinds.inl: one row per light: FORM(ENUM, prefix, Record, "xml name", PARAMS, table): what it derives is `table`_size
// numbers that `table`_follow brings up to date. The form says what the header provides beside prefix_sample, prefix_eval
// and prefix_adj:
//   EMITTER_SURFACE      radiance of a shape: prefix_pdf of directions that meet it
//   EMITTER_ENVIRONMENT  radiance from beyond the scene: prefix_uv of a direction, prefix_pdf and prefix_pdf_adj of
//                        both, prefix_move_adj
//   EMITTER_DELTA        from one direction at each point, so that light sampling alone meets it: prefix_move_adj
EMITTER_SURFACE(AREA, area, Area, "area", AREA_PARAMS, light_nothing)
EMITTER_SURFACE(DIRECTIONALAREA, directionalarea, DirectionalArea, "directionalarea", DIRECTIONALAREA_PARAMS, light_nothing)
EMITTER_ENVIRONMENT(CONSTANT, constant, Constant, "constant", CONSTANT_PARAMS, light_nothing)
EMITTER_ENVIRONMENT(ENVMAP, envmap, Envmap, "envmap", ENVMAP_PARAMS, envmap)
EMITTER_DELTA(POINT, point, Point, "point", POINT_PARAMS, light_nothing)
EMITTER_DELTA(SPOT, spot, Spot, "spot", SPOT_PARAMS, spot)
EMITTER_DELTA(PROJECTOR, projector, Projector, "projector", PROJECTOR_PARAMS, projector)
EMITTER_DELTA(DIRECTIONAL, directional, Directional, "directional", DIRECTIONAL_PARAMS, light_nothing)
