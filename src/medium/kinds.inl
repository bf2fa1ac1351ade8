// kinds.inl: one row per phase function.
// PHASE_LEAF(ENUM, prefix, Record, "xml name", PARAMS, "reference")
// PHASE_ADAPTER(ENUM, prefix, Record, "xml name", PARAMS, number of children, "reference")
PHASE_LEAF(ISOTROPIC, isotropic, Isotropic, "isotropic", NO_PHASE_PARAMS, "")
PHASE_LEAF(HG, hg, Hg, "hg", HG_PARAMS, "henyey1941")
PHASE_LEAF(RAYLEIGH, rayleigh, Rayleigh, "rayleigh", NO_PHASE_PARAMS, "rayleigh1871")
PHASE_LEAF(TABPHASE, tabphase, TabPhase, "tabphase", TABPHASE_PARAMS, "")
PHASE_LEAF(SGGX, sggx, Sggx, "sggx", SGGX_PARAMS, "heitz2015")
PHASE_ADAPTER(BLENDPHASE, blendphase, BlendPhase, "blendphase", BLENDPHASE_PARAMS, 2, "")
