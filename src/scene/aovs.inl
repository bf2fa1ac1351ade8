// aovs.inl: what a sensor can see of the surface behind a pixel, besides colour. AOV(ENUM, "name", "components")
AOV(DEPTH, "depth", "T")            // distance from the ray's beginning, which is on the near plane
AOV(POSITION, "position", "XYZ")
AOV(UV, "uv", "UV")
AOV(GEO_NORMAL, "geo_normal", "XYZ")
AOV(SH_NORMAL, "sh_normal", "XYZ")
AOV(DP_DU, "dp_du", "XYZ")
AOV(DP_DV, "dp_dv", "XYZ")
AOV(DUV_DX, "duv_dx", "UV")         // per pixel over the root of the samples per pixel
AOV(DUV_DY, "duv_dy", "UV")
AOV(PRIM_INDEX, "prim_index", "I")
AOV(SHAPE_INDEX, "shape_index", "I") // from 1 in the order of the file, 0 = none
AOV(ALBEDO, "albedo", "RGB")
