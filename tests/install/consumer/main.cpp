#include <clearance/client.h>

#include <cstdio>
#include <cstring>

// Exceptions of the shared library are caught by their type, and have the right messages.
int main() {
  try {
    clearance::connect("ipc:///dev/null/c.ipc");
  } catch (const clearance::ConnectionError& error) {
    std::puts(error.what());
    return std::strstr(error.what(), "no such socket") ? 0 : 2;
  }
  return 1;
}
