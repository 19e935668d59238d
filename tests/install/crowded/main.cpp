// crowded SCENE MESH: the process's own assimp and LCM work before, between and after Clearance's client and engine.
#include <assimp/scene.h>
#include <clearance/client.h>
#include <clearance/engine.h>
#include <lcm/lcm.h>

#include <assimp/Importer.hpp>
#include <cstdio>
#include <cstdlib>
#include <cstring>

static void check(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::exit(1);
}

static void own_lcm() {
  lcm_t* bus = lcm_create("memq://");
  check(bus, "LCM's own queue");
  int got = 0;
  const auto count = [](const lcm_recv_buf_t* buffer, const char*, void* user) {
    *static_cast<int*>(user) += buffer->data_size == 3;
  };
  lcm_subscribe(bus, "X", count, &got);
  lcm_publish(bus, "X", "abc", 3);
  check(lcm_handle_timeout(bus, 10000) > 0 && got == 1, "a message over it");
  lcm_destroy(bus);
}

static void own_assimp(const char* mesh) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(mesh, 0);
  check(scene && scene->mNumMeshes > 0, "assimp reads a mesh");
}

int main(int, char** argv) {
  own_lcm();
  own_assimp(argv[2]);
  const clearance::Engine engine(clearance::Scene::load(argv[1]));
  check(engine.scene().bodies.size() == 19, "nineteen bodies");
  own_assimp(argv[2]);
  for (const char* url : {"udpm://239.255.76.67:7667?ttl=0", "ipc:///dev/null/c.ipc", "shm:///dev/null/c.sock"}) {
    try {
      clearance::connect(url, std::chrono::milliseconds(50));
      check(false, "nobody serves there");
    } catch (const clearance::ConnectionError& error) {
      std::puts(error.what());
    }
  }
  own_lcm();
}
