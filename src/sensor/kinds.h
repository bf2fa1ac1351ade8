// kinds.h: the numbers of the kinds of sensor.
#pragma once

enum {
#define SENSOR(ENUM, prefix, name) SENSOR_##ENUM,
#include "sensor/kinds.inl"
#undef SENSOR
    SENSOR_BATCH
};
