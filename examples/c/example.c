/* example.c: loads a scene, changes a colour, renders it, differentiates it both ways and saves it.
 * usage: example SCENE.xml PARAMETER OUT.xml */
#include <reynolds/reynolds.h>
#include <stdio.h>
#include <stdlib.h>

#define CHECK(call) \
    if ((call) != REY_OK) { fprintf(stderr, "%s\n", rey_error(ctx)); return 1; }

int main(int argc, char **argv) {
    rey_context *ctx = NULL;
    rey_scene *scene = NULL;
    int width, height, param, i;
    if (argc != 4) { fprintf(stderr, "usage: example SCENE.xml PARAMETER OUT.xml\n"); return 2; }
    if (rey_context_create(NULL, &ctx) != REY_OK) { return 1; }
    CHECK(rey_scene_load(ctx, argv[1], NULL, 0, &scene));
    for (i = 0; i < rey_param_count(scene); i++) {
        rey_param_info info;
        CHECK(rey_param_get_info(scene, i, &info));
        printf("%-40s %lld numbers\n", info.name, (long long)info.count);
    }
    param = rey_param_find(scene, argv[2]);
    if (param < 0) { fprintf(stderr, "there is no parameter %s\n", argv[2]); return 1; }
    CHECK(rey_param_set(scene, param, (float[]){0.2f, 0.4f, 0.6f}, 3));
    CHECK(rey_scene_film_size(scene, 0, &width, &height));
    size_t n = (size_t)width * (size_t)height * 3;
    float *image = malloc(n * sizeof *image), *derivative = malloc(n * sizeof *image), *ones = malloc(n * sizeof *image);
    double gradient[3];
    rey_render_def def = rey_default_render_def();
    def.spp = 16;
    for (size_t k = 0; k < n; k++) { ones[k] = 1; }
    CHECK(rey_render(scene, &def, image, NULL));
    CHECK(rey_jvp(scene, &def, (rey_selection){&param, 1}, (float[]){1, 1, 1}, derivative, NULL, NULL));
    CHECK(rey_vjp(scene, &def, (rey_selection){&param, 1}, ones, gradient, NULL, NULL));
    printf("d sum(image) / d %s = %g %g %g\n", argv[2], gradient[0], gradient[1], gradient[2]);
    CHECK(rey_scene_save(scene, argv[3]));
    free(image), free(derivative), free(ones);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
    return 0;
}
