// Skips tests that need a GPU if there is none.
#pragma once

#include <gtest/gtest.h>

#include "engine/device/device.h"

#define SKIP_WITHOUT_DEVICE() \
  if (!cuda::device_info().present) GTEST_SKIP() << "no CUDA device: " << cuda::device_info().reason
