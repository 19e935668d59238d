#pragma once

namespace clearance::test {

/// Loses this process's CUDA device for good.
void break_device();

}  // namespace clearance::test
