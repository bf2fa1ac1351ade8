// report_about.c: how a report was made: command, versions, machine, times, and the job with its defaults.
#include "fit/report_parts.h"

#include "base/parallel.h"
#include "commit.h"

#include <stdio.h>
#include <string.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

static void put_processor(Text *html) {
    FILE *file = fopen("/proc/cpuinfo", "r");
    char line[512];
    const char *name = NULL;
    while (file && !name && fgets(line, sizeof line, file)) {
        char *colon = strncmp(line, "model name", 10) ? NULL : strchr(line, ':');
        if (colon) {
            colon[1 + strcspn(colon + 1, "\n")] = 0;
            name = colon + 1;
        }
    }
    rey_text_html(html, name ? name : "unknown");
    if (file) {
        fclose(file);
    }
}

static void put_system(Text *html) {
    struct utsname name;
    if (!uname(&name)) {
        rey_text_html(html, name.sysname);
        rey_text_add(html, " ");
        rey_text_html(html, name.release);
        rey_text_add(html, ", ");
    }
    rey_text_add(html, "%.1f GB of memory",
                 (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE) / 1e9);
}

static void put_times(const FitResult *out, Text *html) {
    char date[64] = "";
    time_t now = time(NULL);
    struct tm parts;
    if (gmtime_r(&now, &parts)) {
        strftime(date, sizeof date, "%Y-%m-%d %H:%M UTC", &parts);
    }
    rey_text_add(html,
                 "<dt>times</dt><dd>optimisation %.1f s, %.3g s an iteration</dd><dt>memory</dt><dd>%.0f MB at "
                 "most</dd><dt>finished</dt><dd>%s</dd>",
                 out->seconds, out->iterations ? out->seconds / out->iterations : 0, (double)rey_peak_rss() / 1e6, date);
}

rey_result rey_report_about(Fit *fit, const FitResult *out, Text *html) {
    char *job = NULL;
    rey_text_add(html, "<h2>How it was made</h2>\n<dl>");
    if (fit->def->command) {
        rey_text_add(html, "<dt>command</dt><dd><code>");
        rey_text_html(html, fit->def->command);
        rey_text_add(html, "</code></dd>");
    }
    rey_text_add(html, "<dt>version</dt><dd>Reynolds %s", rey_version());
    rey_text_add(html, REY_COMMIT[0] ? ", commit %s</dd>" : "%s</dd>", REY_COMMIT);
    rey_text_add(html, "<dt>seed</dt><dd>%u</dd><dt>processor</dt><dd>", (unsigned)fit->job.seed);
    put_processor(html);
    rey_text_add(html, "; %d threads, %d lanes</dd><dt>system</dt><dd>", rey_threads(fit->ctx), rey_lanes(fit->ctx));
    put_system(html);
    rey_text_add(html, "</dd>");
    put_times(out, html);
    rey_text_add(html, "</dl>\n");
    rey_result result = rey_job_yaml(&fit->job, &job);
    if (!result) {
        rey_text_add(html, "<h2>Resolved job</h2>\n<details><summary>every setting, defaults included</summary><pre>");
        rey_text_html(html, job);
        rey_text_add(html, "</pre></details>\n");
    }
    rey_free(fit->ctx, job);
    return result;
}
