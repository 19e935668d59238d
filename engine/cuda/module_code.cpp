// Apart from the kernels, which need not be compiled again when code of the engine's changes that they do not include.
#include "engine_code.h"

extern "C" __attribute__((visibility("default"))) const char* const clearance_device_module_code =
    clearance::kEngineCode;
