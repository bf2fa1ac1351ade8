// warp.h: maps from the unit square to other domains with a known density, and those densities. Local frame, axis +z.
#pragma once

#include "math/vec.h"

// Whether an event of a probability happens, by a uniform number, which is uniform again afterwards.
KFN Mask warp_event(Float probability, Float *u) {
    Mask happens = m_lt(*u, probability);
    *u = f_select(happens, *u * f_safe_rcp(probability), (*u - probability) / (1.0f - probability));
    *u = f_min(*u, f_set(0.99999994f));
    return happens;
}

// The unit disk in polar coordinates: radius from u.y, angle from u.x. Density 1 / pi.
KFN Vec2 warp_uniform_disk_polar(Vec2 u) {
    Float sine, cosine, r = f_sqrt(u.y);
    f_sincos(TWO_PI * u.x, &sine, &cosine);
    return (Vec2){r * cosine, r * sine};
}

// The unit disk, concentric squares to concentric circles [shirley1997]: keeps strata compact. Density 1 / pi.
KFN Vec2 warp_uniform_disk(Vec2 u) {
    Float x = 2.0f * u.x - 1.0f, y = 2.0f * u.y - 1.0f;
    Mask steep = m_lt(f_abs(x), f_abs(y));
    Float r = f_select(steep, y, x), other = f_select(steep, x, y);
    Float phi = 0.25f * PI * other * f_safe_rcp(r);
    Float sine, cosine;
    f_sincos(phi, &sine, &cosine);
    return (Vec2){r * f_select(steep, sine, cosine), r * f_select(steep, cosine, sine)};
}

// The triangle (0, 0), (1, 0), (0, 1). Density 2.
KFN Vec2 warp_uniform_triangle(Vec2 u) {
    Float t = f_safe_sqrt(1.0f - u.x);
    return (Vec2){1.0f - t, t * u.y};
}

KFN Vec3 warp_uniform_sphere(Vec2 u) {
    Float sine, cosine;
    f_sincos(TWO_PI * u.x, &sine, &cosine);
    Float r = 2.0f * f_safe_sqrt(u.y * (1.0f - u.y)); // sin of the angle whose cosine is 1 - 2 u.y
    return v3(r * cosine, r * sine, 1.0f - 2.0f * u.y);
}
KFN Float warp_uniform_sphere_pdf(void) { return f_set(INV_FOUR_PI); }

// Directions with cosine at least cos_cutoff.
KFN Vec3 warp_uniform_cone(Vec2 u, Float cos_cutoff) {
    Vec2 d = warp_uniform_disk(u);
    // 1 - z is uniform in [0, 1 - cos_cutoff], as is the squared radius of the disk; sin^2 = (1 - z)(1 + z)
    Float height = 1.0f - cos_cutoff, r2 = d.x * d.x + d.y * d.y;
    Float scale = f_safe_sqrt(height * (2.0f - height * r2));
    return v3(d.x * scale, d.y * scale, 1.0f - height * r2);
}
KFN Float warp_uniform_cone_pdf(Vec3 v, Float cos_cutoff) {
    return f_zero_unless(m_ge(v.z, cos_cutoff), INV_TWO_PI * f_safe_rcp(1.0f - cos_cutoff));
}

KFN Vec3 warp_uniform_hemisphere(Vec2 u) { return warp_uniform_cone(u, f_set(0)); }
KFN Float warp_uniform_hemisphere_pdf(Vec3 v) { return f_zero_unless(m_ge(v.z, f_set(0)), f_set(INV_TWO_PI)); }

// The disk lifted to the sphere. The height keeps away from 0, so that no direction has density 0.
KFN Vec3 warp_cosine_hemisphere(Vec2 u) {
    Vec2 d = warp_uniform_disk(u);
    return v3(d.x, d.y, f_sqrt(f_max(1.0f - d.x * d.x - d.y * d.y, f_set(1e-10f))));
}
KFN Float warp_cosine_hemisphere_pdf(Vec3 v) { return INV_PI * f_max(v.z, f_set(0)); }
