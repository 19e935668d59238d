// Each body's nearest neighbour, as comma-separated values:  nearest URL
//
//   nearest ipc:///run/user/1000/clearance.ipc
//
// Numbers have 17 digits, enough to reproduce the bits when they are read. The URL selects the transport.
// status is a clearance::Status: 0 to 4 are answers; higher values mean that a body has no pose or an invalid one.
#include <clearance/client.h>

#include <cstdio>
#include <exception>
#include <utility>

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "usage: nearest URL\n");
    return 2;
  }
  clearance::Client client = clearance::connect(argv[1]);
  const clearance::Result result = client.distances({
      .reduce = clearance::Reduce::kNearest,
      .fields = clearance::kDefaultFields | clearance::kFieldPoints | clearance::kFieldPair,
  });

  const auto& bodies = client.scene().bodies;
  std::printf("# pose revision %llu\n", static_cast<unsigned long long>(result.snapshot_revision()));
  std::printf("body,neighbour,distance,lower,upper,status,x,y,z,other_x,other_y,other_z\n");
  for (std::size_t i = 0; i < result.rows(); ++i) {
    const auto [a, b] = result.pair()[i];
    const double* p_body = &result.point_a()[3 * i];
    const double* p_other = &result.point_b()[3 * i];
    // Row i is body i; its neighbour is the other one of the pair, before or after it.
    const std::uint32_t other = a == i ? b : a;
    if (other == a) std::swap(p_body, p_other);
    std::printf("%s,%s,%.17g,%.17g,%.17g,%d", bodies[i].name.c_str(),
                other < bodies.size() ? bodies[other].name.c_str() : "(none)", result.distance()[i], result.lower()[i],
                result.upper()[i], static_cast<int>(result.status()[i]));
    std::printf(",%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", p_body[0], p_body[1], p_body[2], p_other[0], p_other[1],
                p_other[2]);
  }
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "nearest: %s\n", error.what());
  return 1;
}
