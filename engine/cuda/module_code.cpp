// Separate from the kernels, so that they are not recompiled when engine code that they do not include changes.
#include "engine_code.h"

extern "C" __attribute__((visibility("default"))) const char* const clearance_device_module_code =
    clearance::kEngineCode;
