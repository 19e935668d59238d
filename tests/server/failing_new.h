// A program's own operator new, of which one allocation can be made to fail.
#pragma once

namespace clearance {

/// Allocations of this thread until one fails, once; below 0: none does.
extern thread_local int allocations_left;

}  // namespace clearance
