#pragma once

namespace clearance::test {

/// Makes this process's CUDA device unusable for good.
void break_device();

}  // namespace clearance::test
