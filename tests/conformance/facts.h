// facts.h: what the tables of numbers share.
#pragma once

#include "conformance.h"

// How many numbers of one table agree.
typedef struct Tally {
    int tested, agreed;
    double worst;    // largest error over its tolerance
    char first[128]; // what disagreed first
} Tally;

void facts_tally(Tally *t, const char *what, double value, double expected, double tolerance);
void facts_report(Suite *suite, const char *name, const Tally *t);
JsonNode *facts_read(const Suite *suite, const char *name); // null when there is no such file
double facts_item(const JsonNode *array, int i);            // NaN when there is none
// Loads a scene from text.
rey_result facts_load(Suite *suite, const char *text, rey_scene **scene);

void run_volume_facts(Suite *suite, const char *name);
void run_phase_facts(Suite *suite, const char *name);
