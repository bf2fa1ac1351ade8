// report.h: report.html, one self-contained file.
#pragma once

#include "fit/fit.h"

// Renders every view at the start and at the result and writes the report; sets result->report.
rey_result rey_report_write(Fit *fit, FitResult *result);
