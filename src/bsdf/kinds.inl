// kinds.inl: one row per scattering function.
// BSDF_LEAF(ENUM, prefix, Record, "xml name", PARAMS, CONFIG, "reference")
// BSDF_ADAPTER(ENUM, prefix, Record, "xml name", PARAMS, CONFIG, fewest children, most children, "reference")
BSDF_LEAF(DIFFUSE, diffuse, Diffuse, "diffuse", DIFFUSE_PARAMS, NO_CONFIG, "lambert1760")
BSDF_LEAF(NULL, null, Null, "null", NO_PARAMS, NO_CONFIG, "")
BSDF_ADAPTER(TWOSIDED, twosided, Twosided, "twosided", NO_PARAMS, NO_CONFIG, 1, 2, "")
BSDF_ADAPTER(MASK, mask, MaskBsdf, "mask", MASK_PARAMS, NO_CONFIG, 1, 1, "")
