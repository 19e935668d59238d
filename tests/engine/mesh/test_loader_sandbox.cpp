// A mesh loader that a file has taken over can do no more than read files, take memory and end.
#include <gtest/gtest.h>
#include <signal.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "engine/mesh/mesh.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

class LoaderSandbox : public testing::Test {
 protected:
  void SetUp() override {
    ::setenv("CLEARANCE_MESH_LOADER", CLEARANCE_HOSTILE_LOADER, 1);
    ASSERT_EQ(attempt("nothing"), "done");
    if (!mesh_loader_warning().empty()) GTEST_SKIP() << mesh_loader_warning();
  }
  void TearDown() override {
    ::unsetenv("CLEARANCE_MESH_LOADER");
    ::unsetenv("CLEARANCE_TEST_UNCONFINED");
  }
  /// Error text of load_mesh() when the loader does `what`.
  std::string attempt(const std::string& what) {
    const std::string path = folder_.write("mesh.obj", what + "\n");
    return error_text<MeshError>([&] { load_mesh(path); });
  }
  TemporaryFolder folder_;
};

TEST_F(LoaderSandbox, WhatAMeshNeedsIsAllowed) {
  EXPECT_EQ(attempt("read_the_file"), "done");
  EXPECT_EQ(attempt("take_memory"), "done");
}

TEST_F(LoaderSandbox, AnythingElseEndsTheLoaderAndReportsIt) {
  for (const char* what : {"open_a_network_socket",
                           "open_a_unix_socket",
                           "run_a_program",
                           "fork",
                           "create_a_file",
                           "open_for_writing",
                           "append",
                           "open_by_the_newest_way",
                           "remove_a_file",
                           "rename_a_file",
                           "link_a_file",
                           "change_rights",
                           "signal_the_parent",
                           "signal_the_parents_thread",
                           "trace_the_parent",
                           "read_the_parents_memory",
                           "make_code_from_data",
                           "make_memory_executable",
                           "make_another_memory_file",
                           "ask_the_kernel_by_a_ring",
                           "catch_the_end",
                           "sleep"}) {
    SCOPED_TRACE(what);
    const std::string error = attempt(what);
    EXPECT_EQ(error.find("reading it was stopped: the mesh loader made system call "), 0u) << error;
    EXPECT_NE(error.find("which no mesh file needs; is the file hostile?"), std::string::npos) << error;
    std::size_t files = 0;
    for ([[maybe_unused]] const auto& file : std::filesystem::directory_iterator(folder_.path())) ++files;
    EXPECT_EQ(files, 1u) << "something was left beside the mesh";
    // It is the filter that stops it: without one nothing does.
    ::setenv("CLEARANCE_TEST_UNCONFINED", "1", 1);
    EXPECT_EQ(attempt(what).find("reading it was stopped"), std::string::npos);
    ::unsetenv("CLEARANCE_TEST_UNCONFINED");
    for (const auto& file : std::filesystem::directory_iterator(folder_.path())) std::filesystem::remove(file.path());
  }
}

TEST_F(LoaderSandbox, TheRealLoaderIsHeldByItAndReadsEveryFormat) {
  using namespace mesh_files;
  ::unsetenv("CLEARANCE_MESH_LOADER");
  const Source thing = ball();
  const std::pair<const char*, std::string> files[] = {{"a.obj", obj(thing)},
                                                       {"a.stl", stl_text(thing)},
                                                       {"b.stl", stl_binary(thing)},
                                                       {"a.ply", ply(thing, Ply::kText)},
                                                       {"b.ply", ply(thing, Ply::kBig)},
                                                       {"a.off", off(thing)},
                                                       {"a.dae", dae(thing)},
                                                       {"a.gltf", gltf(thing)},
                                                       {"a.glb", glb(thing)},
                                                       {"a.x3d", x3d(thing)},
                                                       {"a.amf", amf(thing)},
                                                       {"a.ase", ase(thing)},
                                                       {"a.dxf", dxf(thing)},
                                                       {"a.lwo", lwo(thing)}};
  for (const auto& [name, text] : files) {
    SCOPED_TRACE(name);
    EXPECT_EQ(load_mesh(folder_.write(name, text)).submeshes.at(0).vertices.size(), thing.vertices.size());
  }
  EXPECT_EQ(mesh_loader_warning(), "");
}

// The last, since the warning stays.
TEST_F(LoaderSandbox, WhereTheKernelRejectsFiltersMeshesAreReadAndTheDaemonLearnsIt) {
  ::setenv("CLEARANCE_TEST_REFUSE_FILTERS", "1", 1);
  EXPECT_EQ(attempt("open_a_unix_socket"), "done");
  EXPECT_NE(mesh_loader_warning().find("without a filter of system calls"), std::string::npos);
  ::unsetenv("CLEARANCE_TEST_REFUSE_FILTERS");
}

}  // namespace
}  // namespace clearance
