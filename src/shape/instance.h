// instance.h: surfaces of a shapegroup seen through an instance: p = M q, normals by the inverse transpose. Table of an
// instance: rows of to_world (12), rows of its inverse (12).
#pragma once

#include "shape/motion.h"
#include "shape/pose.h"

#define INSTANCE_TABLE 24

KFN Int instance_table(const SceneView *scene, const Hit *hit) {
    return i_gather((const int32_t *)scene->instances, hit->instance * (int32_t)(sizeof(InstanceRecord) / 4) +
                                                           (int32_t)(offsetof(InstanceRecord, table) / 4));
}

// The hit in the group's own space.
KFN Hit instance_hit(const SceneView *scene, const Hit *hit) {
    Hit local = *hit;
    local.p = pose_to_local(scene, instance_table(scene, hit), hit->p);
    return local;
}

KFN Interaction instance_interaction(const SceneView *scene, const Hit *hit, const Interaction *local) {
    Int at = instance_table(scene, hit);
    Interaction si = *local;
    si.p = pose_to_world(scene, at, local->p);
    si.ng = pose_normal(scene, at, local->ng);
    Vec3 x = table_v3(scene, at), y = table_v3(scene, at + 4), z = table_v3(scene, at + 8);
    si.dp_du = v3(v3_dot(x, local->dp_du), v3_dot(y, local->dp_du), v3_dot(z, local->dp_du));
    si.dp_dv = v3(v3_dot(x, local->dp_dv), v3_dot(y, local->dp_dv), v3_dot(z, local->dp_dv));
    si.sh = frame_from_tangent(pose_normal(scene, at, local->sh.n), si.dp_du);
    return si;
}

// The adjoint dn of the world's unit normal n = normalize(M^-T m) becomes that of m, a unit normal in the group's space.
KFN Vec3 instance_normal_adj(const SceneView *scene, const Hit *hit, Vec3 m, Vec3 dn) {
    Int at = instance_table(scene, hit);
    Vec3 x = table_v3(scene, at + 12), y = table_v3(scene, at + 16), z = table_v3(scene, at + 20), dq = v3_zero();
    Vec3 q = v3_madd(v3_madd(v3_scale(x, m.x), m.y, y), m.z, z);
    v3_normalize_adj(q, dn, &dq);
    return v3(v3_dot(x, dq), v3_dot(y, dq), v3_dot(z, dq));
}

KFN Vec3 instance_vector(const SceneView *scene, Int at, Vec3 v) {
    return v3(v3_dot(table_v3(scene, at), v), v3_dot(table_v3(scene, at + 4), v), v3_dot(table_v3(scene, at + 8), v));
}

// From what slides in the group's space to what that does in the world.
KFN Slide instance_slide(const SceneView *scene, const Hit *hit, const Interaction *local, const Slide *s) {
    Int at = instance_table(scene, hit);
    Slide out = *s;
    out.p = instance_vector(scene, at, s->p);
    out.dp_du = instance_vector(scene, at, s->dp_du);
    out.dp_dv = instance_vector(scene, at, s->dp_dv);
    Vec3 x = table_v3(scene, at + 12), y = table_v3(scene, at + 16), z = table_v3(scene, at + 20);
#define BY_NORMAL(n) v3_madd(v3_madd(v3_scale(x, (n).x), (n).y, y), (n).z, z)
    out.ng = slide_normalized(BY_NORMAL(local->ng), BY_NORMAL(s->ng));
    out.n = slide_normalized(BY_NORMAL(local->sh.n), BY_NORMAL(s->n));
    return out;
}

// From the adjoint of an interaction in the world to that of the same in the group's space.
KFN SurfaceAdj instance_local_adj(const SceneView *scene, const Hit *hit, const Interaction *local, const SurfaceAdj *d) {
    Int at = instance_table(scene, hit);
    Vec3 c0 = pose_column(scene, at, 0), c1 = pose_column(scene, at, 1), c2 = pose_column(scene, at, 2);
#define BACK(v) v3(v3_dot(c0, v), v3_dot(c1, v), v3_dot(c2, v))
    SurfaceAdj out = *d;
    out.p = BACK(d->p);
    out.dp_du = BACK(d->dp_du);
    out.dp_dv = BACK(d->dp_dv);
    out.ng = instance_normal_adj(scene, hit, local->ng, d->ng);
    out.n = instance_normal_adj(scene, hit, local->sh.n, d->n);
    // the area vector follows the inverse transpose, in units of its own length
    Vec3 x = table_v3(scene, at + 12), y = table_v3(scene, at + 16), z = table_v3(scene, at + 20);
    Float rcp = f_safe_rcp(v3_length(BY_NORMAL(local->ng)));
    out.area = v3_scale(v3(v3_dot(x, d->area), v3_dot(y, d->area), v3_dot(z, d->area)), rcp);
    return out;
#undef BY_NORMAL
#undef BACK
}
