// A mesh loader process that hangs, crashes, returns invalid data or runs out of memory.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>

#include "engine/base/sanitizers.h"
#include "engine/mesh/mesh.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using namespace mesh_files;

// A loader that behaves as a damaged file might make the real one behave.
class FakeLoader {
 public:
  FakeLoader(const TemporaryFolder& folder, const std::string& script) {
    const std::string path = folder.write("loader", "#!/bin/sh\n" + script + "\n");
    ::chmod(path.c_str(), 0700);
    ::setenv("CLEARANCE_MESH_LOADER", path.c_str(), 1);
  }
  ~FakeLoader() { ::unsetenv("CLEARANCE_MESH_LOADER"); }
};

TEST(Mesh, ALoaderThatHangsCrashesOrTalksNonsenseDoesNoHarm) {
  const TemporaryFolder folder;
  const std::string good = folder.write("good.obj", obj(tetrahedron()));
  MeshLimits limits;
  const auto error_with = [&](const std::string& script) {
    const FakeLoader fake(folder, script);
    return error_text<MeshError>([&] { load_mesh(good, limits); });
  };
  EXPECT_EQ(error_with("kill -SEGV $$"), "the mesh library crashed on it (Segmentation fault); is the file damaged?");
  EXPECT_EQ(error_with("kill -ABRT $$"), "the mesh library crashed on it (Aborted); is the file damaged?");
  EXPECT_EQ(error_with("kill -KILL $$"), "the mesh loader was killed while reading it (out of memory?)");
  EXPECT_EQ(error_with("kill -XCPU $$"), "reading it took too much processor time; is the file damaged?");
  EXPECT_EQ(error_with("exit 3"), "the mesh loader ended with code 3 and no result; is the file damaged?");
  EXPECT_EQ(error_with("exit 0"), "the mesh loader ended with code 0 and no result; is the file damaged?");
  EXPECT_EQ(error_with("echo nonsense that is longer than a header of 40 bytes >&3"),
            "the mesh loader ended with code 0 and no result; is the file damaged?");
  const std::string garbled = "the mesh loader's result is corrupted; is the file damaged?";
  // Magic, state, submeshes, bytes of the error text, bytes in all, limits; then a submesh's vertices, triangles,
  // loaded vertices, rounding.
  const std::string good_state = R"(printf 'cmesh003\001\0\0\0\001\0\0\0\0\0\0\0\0\0\0\0)";
  const std::string limits_held = R"(\0\0\0\0\0\0\0\0)";
  EXPECT_EQ(error_with(good_state + R"(\051\0\0\0\0\0\0\0)" + limits_held + "' >&3"), garbled)
      << "one byte promised too many";
  EXPECT_EQ(error_with(good_state + R"(\050\0\0\0\0\0\0\0)" + limits_held + "' >&3"), garbled)
      << "the submesh is not there";
  EXPECT_EQ(error_with(good_state + R"(\110\0\0\0\0\0\0\0)" + limits_held +
                       R"(\377\377\377\377\377\377\377\377\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0' >&3)"),
            garbled)
      << "2^64 - 1 vertices";
  const auto zeros = [](int n) {
    std::string out;
    while (n-- > 0) out += R"(\0)";
    return out;
  };
  const std::string one_of_each =
      R"(\160\0\0\0\0\0\0\0)" + limits_held + R"(\001\0\0\0\0\0\0\0\001\0\0\0\0\0\0\0\001\0\0\0\0\0\0\0)" + zeros(32);
  EXPECT_EQ(error_with(good_state + one_of_each + zeros(16) + "' >&3"), "")
      << "one vertex and one triangle: a good answer";
  EXPECT_EQ(error_with(good_state + one_of_each + R"(\007)" + zeros(15) + "' >&3"), garbled)
      << "a triangle past the end";
  EXPECT_EQ(
      error_with(R"(printf 'cmesh003\002\0\0\0\0\0\0\0\377\377\0\0\0\0\0\0\050\0\0\0\0\0\0\0)" + limits_held + "' >&3"),
      garbled)
      << "a long error text";
  EXPECT_EQ(error_with("exec 4>&-; exec sleep 1000"), "the mesh loader was killed while reading it (out of memory?)")
      << "it says that it has ended, and goes on";
  limits.time = std::chrono::milliseconds(200);
  EXPECT_EQ(error_with("echo done >&4; exec sleep 1000"), "reading it took longer than 0.200 s; is the file damaged?");
  EXPECT_EQ(error_with("exec sleep 1000"), "reading it took longer than 0.200 s; is the file damaged?");
  limits = {};
  const std::string none = folder / "none";
  ::setenv("CLEARANCE_MESH_LOADER", none.c_str(), 1);
  EXPECT_EQ(error_text<MeshError>([&] { load_mesh(good); }), "CLEARANCE_MESH_LOADER=" + none + " is not a program");
  ::unsetenv("CLEARANCE_MESH_LOADER");
  EXPECT_EQ(load_mesh(good).submeshes.size(), 1u);
}

#if !defined(CLEARANCE_ASAN) && !defined(CLEARANCE_TSAN)
TEST(Mesh, AFileThatNeedsMoreMemoryThanAllowedIsRejected) {
  const TemporaryFolder folder;
  const Shape shape = make_uv_sphere(1, 400);
  const std::string file = folder.write("a.ply", ply({shape.vertices, shape.triangles}, Ply::kLittle));
  MeshLimits limits;
  limits.memory_bytes = 64 << 20;
  EXPECT_EQ(error_text<MeshError>([&] { load_mesh(file, limits); }),
            "reading it takes more than 64 MiB of memory; is the file damaged?");
  EXPECT_EQ(load_mesh(file).submeshes[0].vertices.size(), shape.vertices.size());
}
#endif

}  // namespace
}  // namespace clearance
