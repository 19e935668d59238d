// Direction tables kept beside meshes: used when in order, made anew when not, never an error.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "engine/digest.h"
#include "engine/scene.h"
#include "engine/shapes.h"
#include "engine/table_file.h"
#include "mesh_files.h"
#include "temporary_folder.h"

namespace clearance {
namespace {

namespace fs = std::filesystem;

bool same(const DirectionTable& a, const DirectionTable& b) {
  return a.grid_bits == b.grid_bits && a.cells == b.cells && a.lists == b.lists;
}

std::string contents(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class TableFile : public testing::Test {
 protected:
  static constexpr double kRho = 2.001;
  static constexpr std::size_t kHeader = 8 * sizeof(std::uint64_t), kKeyAt = 2, kCellsAt = 5, kChecksumAt = 7;

  DirectionTable table(std::size_t few = 6) const { return direction_table_beside(mesh_, sphere_.vertices, kRho, few); }
  DirectionTable made(std::size_t few = 6) const { return make_direction_table(sphere_.vertices, kRho, few); }
  std::vector<fs::path> files() const {
    std::vector<fs::path> all;
    for (const auto& entry : fs::directory_iterator(folder_.path())) all.push_back(entry.path());
    return all;
  }
  static void put(const fs::path& path, const std::string& content) { std::ofstream(path, std::ios::binary) << content; }
  static std::uint64_t& word(std::string& content, std::size_t i) {
    return reinterpret_cast<std::uint64_t*>(content.data())[i];
  }
  static std::uint32_t* entries(std::string& content) { return reinterpret_cast<std::uint32_t*>(content.data() + kHeader); }
  // Makes the checksum right again, as one would who wants to fool the reader.
  static void sign(std::string& content) {
    Digest d;
    d.add(word(content, 4));
    const std::uint64_t cells = word(content, kCellsAt), lists = word(content, kCellsAt + 1);
    const std::uint32_t* at = entries(content);
    for (const std::uint64_t count : {cells, lists}) {
      for (std::uint64_t i = 0; i < count; i += 2) d.add(std::uint64_t{at[i]} << 32 | (i + 1 < count ? at[i + 1] : 0));
      at += count;
    }
    word(content, kChecksumAt) = d.value();
  }

  TemporaryFolder folder_;
  std::string mesh_ = folder_ / "ball.ply";
  Shape sphere_ = make_uv_sphere(2, 75);  // 11,102 vertices
};

TEST_F(TableFile, IsWrittenOnceAndReadThen) {
  ASSERT_GE(sphere_.vertices.size(), kTableFileFromVertices);
  const DirectionTable first = table();
  EXPECT_TRUE(same(first, made()));
  ASSERT_EQ(files().size(), 1u);
  const fs::path file = files()[0];
  EXPECT_EQ(file.string().find(mesh_ + "."), 0u) << file;
  EXPECT_TRUE(same(table(), first));
  EXPECT_EQ(files().size(), 1u);

  // That it is read shows when a table that was made otherwise, as exact, stands in its place.
  ASSERT_FALSE(same(made(16), first));
  table(16);
  ASSERT_EQ(files().size(), 2u);
  const fs::path other = files()[0] == file ? files()[1] : files()[0];
  std::string content = contents(other);
  const std::string own = contents(file);
  word(content, kKeyAt) = reinterpret_cast<const std::uint64_t*>(own.data())[kKeyAt];
  put(file, content);
  EXPECT_TRUE(same(table(), made(16)));
}

TEST_F(TableFile, ThatIsDamagedIsMadeAnew) {
  const DirectionTable right = table();
  const fs::path file = files().at(0);
  const std::string whole = contents(file);
  PortableRandom random(1);
  for (int i = 0; i < 24; ++i) {
    std::string damaged = whole;
    const auto at = static_cast<std::size_t>(random.uniform(0, i % 2 ? kHeader : static_cast<double>(whole.size())));
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << i % 8));
    put(file, damaged);
    EXPECT_TRUE(same(table(), right)) << "byte " << at;
    EXPECT_EQ(contents(file), whole) << "byte " << at;
  }
  for (const std::size_t length : {std::size_t{0}, std::size_t{1}, kHeader - 1, kHeader, whole.size() / 2, whole.size() - 1}) {
    put(file, whole.substr(0, length));
    EXPECT_TRUE(same(table(), right)) << length << " bytes";
  }
  put(file, whole + "more");
  EXPECT_TRUE(same(table(), right));
  EXPECT_EQ(contents(file), whole);
}

// Words that would make a reader run in circles or past the end, under a checksum that is right.
TEST_F(TableFile, ThatWouldLeadAstrayIsMadeAnew) {
  const DirectionTable right = table();
  const fs::path file = files().at(0);
  const std::string whole = contents(file);
  const std::size_t cells = right.cells.size(), lists = right.lists.size(), grid = std::size_t{1} << (2 * right.grid_bits);
  ASSERT_GT(cells, grid) << "no cell was divided";
  std::size_t divided = 0;
  while (!(right.cells[divided] & DirectionTable::kDivided)) ++divided;
  const std::uint32_t far = static_cast<std::uint32_t>(cells);
  int refused = 0;
  const auto expect_refused = [&](const char* what, auto&& change) {
    std::string content = whole;
    change(content);
    sign(content);
    ASSERT_NE(content, whole) << what;
    put(file, content);
    EXPECT_TRUE(same(table(), right)) << what;
    EXPECT_EQ(contents(file), whole) << what;
    ++refused;
  };
  expect_refused("a cell divided into itself", [&](std::string& c) { entries(c)[divided] = DirectionTable::kDivided | static_cast<std::uint32_t>(divided); });
  expect_refused("a cell divided into the grid", [&](std::string& c) { entries(c)[cells - 1] = DirectionTable::kDivided; });
  expect_refused("a cell divided past the end", [&](std::string& c) { entries(c)[divided] = DirectionTable::kDivided | (far - 3); });
  expect_refused("a list past the end", [&](std::string& c) { entries(c)[cells - 1] = static_cast<std::uint32_t>(lists); });
  expect_refused("a list that begins within another", [&](std::string& c) { entries(c)[cells - 1] = 1; });
  expect_refused("an empty list", [&](std::string& c) { entries(c)[cells] = 0; });
  expect_refused("a list longer than there are words", [&](std::string& c) { entries(c)[cells] = 0xFFFFFFFF; });
  expect_refused("a vertex that is not there", [&](std::string& c) { entries(c)[cells + 1] = static_cast<std::uint32_t>(sphere_.vertices.size()); });
  expect_refused("a grid of other fineness", [&](std::string& c) { word(c, 4) += 1; });
  expect_refused("no grid", [&](std::string& c) { word(c, 4) = 0; });
  expect_refused("a grid of 2^255 cells", [&](std::string& c) { word(c, 4) = 255; });
  expect_refused("vertices that are not the farthest", [&](std::string& c) {
    for (std::size_t i = cells; i < cells + lists; i += entries(c)[i] + 1)
      for (std::size_t k = 1; k <= entries(c)[i]; ++k) entries(c)[i + k] = 0;
  });
  EXPECT_EQ(refused, 12);
}

TEST_F(TableFile, OfSomebodyElseIsNotTrusted) {
  table(16);
  const fs::path other = files().at(0);
  const DirectionTable right = table();
  const fs::path file = files()[0] == other ? files()[1] : files()[0];
  std::string content = contents(other);
  const std::string own = contents(file);
  word(content, kKeyAt) = reinterpret_cast<const std::uint64_t*>(own.data())[kKeyAt];
  put(file, content);
  ASSERT_TRUE(same(table(), made(16))) << "would be used";
  for (const mode_t mode : {0664, 0646}) {
    put(file, content);
    ASSERT_EQ(::chmod(file.c_str(), mode), 0);
    EXPECT_TRUE(same(table(), right)) << std::oct << mode;
    EXPECT_EQ(contents(file), own);
  }
  fs::remove(file);
  put(folder_ / "elsewhere", content);
  fs::create_symlink(folder_ / "elsewhere", file);
  EXPECT_TRUE(same(table(), right));
  EXPECT_FALSE(fs::is_symlink(file));
  fs::remove(file);
  fs::create_directory(file);
  EXPECT_TRUE(same(table(), right)) << "a folder in its place";
}

TEST_F(TableFile, IsNotWrittenWhereItIsNotWantedOrCannotBe) {
  ASSERT_EQ(::setenv("CLEARANCE_TABLE_FILES", "off", 1), 0);
  EXPECT_TRUE(same(table(), made()));
  ASSERT_EQ(::unsetenv("CLEARANCE_TABLE_FILES"), 0);
  EXPECT_TRUE(files().empty());
  const Shape small = make_uv_sphere(2, 20);
  direction_table_beside(mesh_, small.vertices, kRho, 6);
  EXPECT_TRUE(files().empty());
  EXPECT_TRUE(same(direction_table_beside("", sphere_.vertices, kRho, 6), made()));
  EXPECT_TRUE(same(direction_table_beside(folder_ / "nowhere/ball.ply", sphere_.vertices, kRho, 6), made()));
  EXPECT_TRUE(files().empty());
}

TEST_F(TableFile, ComesWithTheMeshesOfAScene) {
  std::string ply = mesh_files::print("ply\nformat ascii 1.0\nelement vertex %zu\nproperty double x\nproperty double y\nproperty double z\n",
                                      sphere_.vertices.size()) +
                    mesh_files::print("element face %zu\nproperty list uchar int vertex_indices\nend_header\n", sphere_.triangles.size());
  for (const Vec3d& v : sphere_.vertices) ply += mesh_files::print("%.17g %.17g %.17g\n", v.x, v.y, v.z);
  for (const Triangle& t : sphere_.triangles) ply += mesh_files::print("3 %u %u %u\n", t[0], t[1], t[2]);
  put(mesh_, ply);
  const auto piece = [&](Vec3d scale) {
    Scene scene;
    scene.add_mesh("ball", mesh_, scale, Convexify::kHull, {});
    return scene.bodies()[0].pieces.at(0);
  };
  const PiecePtr first = piece({1, 1, 1});
  EXPECT_EQ(files().size(), 2u);
  const PiecePtr again = piece({1, 1, 1});
  EXPECT_EQ(files().size(), 2u);
  EXPECT_TRUE(same(*first->table, *again->table));
  piece({1, 2, 1});
  EXPECT_EQ(files().size(), 3u) << "another shape, another table";
}

}  // namespace
}  // namespace clearance
