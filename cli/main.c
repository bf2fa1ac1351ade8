// main.c: the table of subcommands, help and dispatch.
#include "cli.h"

#include "base/context.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define DIRECTION_NOTES                                                                                                \
    "\nA direction P is NAME[:OP]. Names are listed by 'reynolds params'; a * in NAME stands for any text: for the\n"  \
    "parameters that move nothing, with OP for those that OP fits. OP is one of\n"                                     \
    "  add=V                       every entry moves by theta*V (default add=1); V may list the last dimension\n"      \
    "  translate=x,y,z             positions, control_points or to_world, in the world\n"                              \
    "  local_translate=x,y,z       to_world, in the object's own frame\n"                                              \
    "  rotate=ax,ay,az[@cx,cy,cz]  theta in degrees, about an axis through a centre\n"                                 \
    "  scale=S[@cx,cy,cz]          positions, control_points or to_world, about a centre\n"                            \
    "  file=TANGENT.npy            a tangent of the parameter's size\n"

typedef struct CommandRow {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *usage;
    const char *summary;
    const char *notes;
} CommandRow;

static const CommandRow command_rows[COMMAND_COUNT] = {
    [COMMAND_RENDER] = {"render", cli_render, "SCENE -o OUT [options]", "render a Mitsuba 3 scene to an image", ""},
    [COMMAND_GRAD] =
        {"grad", cli_grad,
         "SCENE --param P [--param P]... [-o OUT] [options]\n"
         "       reynolds grad SCENE --param P [--param P]... --mode reverse --adjoint A [-o DIR] [options]",
         "derivative image (forward) or gradient (reverse)",
         "\nForward mode writes the derivative image along the direction; its value is the mean over pixels and\n"
         "channels. Reverse mode computes d/dparameter of the sum over pixels and channels of A times image, and tells of\n"
         "each parameter the sum and the root mean square; -o names a folder for all of it, one .npy for each and\n"
         "gradient.json. Several P form one joint direction.\n" DIRECTION_NOTES},
    [COMMAND_CHECK] =
        {"check", cli_check, "SCENE --param P [--param P]... | --all [options]",
         "compare gradients with correlated finite differences",
         "\nEach P is checked by itself, in blocks of the image. Where nothing moves, differences are taken along the\n"
         "paths of the derivative, and held against fresh paths (fresh z); elsewhere along fresh paths. Exits with\n"
         "1 when a gradient is wrong, with 0 when all are right or too noisy to say (weak).\n" DIRECTION_NOTES},
    [COMMAND_FIT] = {"fit", cli_fit, "JOB.yaml [--set key=value]... [--resume] [-o DIR] [options]",
                     "recover parameters from images", ""},
    [COMMAND_PARAMS] =
        {"params", cli_params, "SCENE [options]", "list every parameter of a scene",
         "\nThe column gradient says whether grad computes all of the derivative; below the table stands why not.\n"},
    [COMMAND_INFO] = {"info", cli_info, "SCENE [options]", "say what a scene holds", ""},
    [COMMAND_CONVERT] =
        {"convert", cli_convert, "IN OUT.xml [options]", "write a scene back, with its meshes and images",
         "\nOUT.xml renders the same bits as IN. It is of the current version of the format, needs no define, include "
         "or\nsearch path, and its files lie in the folder OUT_data beside it.\n"},
    [COMMAND_COMPARE] =
        {"compare", cli_compare, "A B [--json]", "differences between two images; B is the reference",
         "\nPictures are EXR, PNG, JPEG, BMP, TGA, Radiance HDR, PFM, PGM, PPM or NPY files.\n"
         "psnr takes 1 as the peak; relative mse is the mean of (A-B)^2 / (B^2 + 1e-2). Numbers that are not finite in\n"
         "either are left out and counted, and make the exit status 1.\n"},
    [COMMAND_DOCTOR] = {"doctor", cli_doctor, "[options]", "examine this machine and this build", ""},
};

const char *cli_command_name(Command command) {
    return command_rows[command].name;
}

void cli_command_help(Command command) {
    const CommandRow *row = &command_rows[command];
    printf("Usage: reynolds %s %s\n\n%s.\n", row->name, row->usage, row->summary);
    cli_options_help(command);
    fputs(row->notes, stdout);
}

static void print_help(FILE *file) {
    fprintf(
        file,
        "Usage: reynolds COMMAND [arguments]\n\n"
        "Reynolds %s: physically based rendering, its derivatives, and scenes recovered from images.\n\nCommands:\n",
        rey_version());
    for (int i = 0; i < COMMAND_COUNT; i++) {
        fprintf(file, "  %-10s %s\n", command_rows[i].name, command_rows[i].summary);
    }
    fprintf(file,
            "\nOptions:\n  -h, --help     print this text; 'reynolds COMMAND --help' tells more\n"
            "      --version  print the version\n\n"
            "Data goes to standard output and words to standard error. Exit status: 0 success, 1 failure, 2 usage,\n"
            "130 interrupted.\n");
}

static const char *command_name_at(void *user, int i) {
    (void)user;
    return i < COMMAND_COUNT ? command_rows[i].name : NULL;
}

// COMMAND_COUNT where there is none of this name.
static int find_command(const char *name) {
    int i = 0;
    while (i < COMMAND_COUNT && strcmp(name, command_rows[i].name) != 0) {
        i++;
    }
    return i;
}

static int unknown_word(const char *word, bool as_json) {
    const char *nearest = rey_nearest_word(word, command_name_at, NULL);
    const char *what = word[0] == '-' ? "option" : "command";
    char message[512];
    snprintf(message, sizeof message, "unknown %s '%.200s'%s%s%s", what, word, nearest ? ", did you mean '" : "",
             nearest ? nearest : "", nearest ? "'?" : "");
    fprintf(stderr, "reynolds: %s\nTry 'reynolds --help'.\n", message);
    if (as_json) {
        cli_json_error(message, "usage");
    }
    return EXIT_USAGE;
}

// A stream that the caller closed would be the next file that is opened, and words would go into it. What stands in its place
// can be neither read nor written.
static void hold_streams(void) {
    for (int i = STDIN_FILENO; i <= STDERR_FILENO; i++) {
        if (fcntl(i, F_GETFD) == -1 && errno == EBADF && open("/dev/null", i == STDIN_FILENO ? O_WRONLY : O_RDONLY) < 0) {
            return; // the lowest number that is free is this one
        }
    }
}

int main(int argc, char **argv) {
    cli_seconds_total();
    hold_streams();
    if (argc < 2) {
        print_help(stderr);
        return EXIT_USAGE;
    }
    const char *word = argv[1];
    int command = find_command(word);
    if (command < COMMAND_COUNT) {
        cli_catch_interrupts();
        return command_rows[command].run(argc - 1, argv + 1);
    }
    if (!strcmp(word, "--version")) {
        printf("reynolds %s\n", rey_version());
        return cli_finish_output();
    }
    if (!strcmp(word, "help") && argc > 2) {
        int asked = find_command(argv[2]);
        if (asked == COMMAND_COUNT) {
            return unknown_word(argv[2], false);
        }
        cli_command_help((Command)asked);
        return cli_finish_output();
    }
    if (!strcmp(word, "-h") || !strcmp(word, "--help") || !strcmp(word, "help")) {
        print_help(stdout);
        return cli_finish_output();
    }
    bool as_json = false;
    for (int i = 2; i < argc; i++) {
        as_json = as_json || !strcmp(argv[i], "--json");
    }
    return unknown_word(word, as_json);
}
