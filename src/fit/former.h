// former.h: what an earlier fit left in a folder.
#pragma once

#include "fit/fit.h"

// Whether the folder holds the remains of a fit: only then are its files ours to remove.
bool rey_former_exists(const Fit *fit);
// Removes every file that a fit writes, and no other, so that what stands there afterwards is the new fit's.
rey_result rey_former_remove(Fit *fit);
// Refuses a job whose scene, or the file that it loads values from, is among them: its start is read again at the end.
rey_result rey_former_refuse_inputs(Fit *fit);
