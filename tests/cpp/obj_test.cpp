// OBJ files with tags: what they mean, and errors with file and line.
#include "limitray/cage/obj.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <string>

#include "cage_files.h"

namespace limitray {
namespace {

const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

ControlCage parse(const std::string& text) { return parse_obj(text, "model.obj"); }

std::string complaint(const std::string& text) {
  try {
    parse(text);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "nothing";
}

TEST(Obj, ReadsPointsExactlyAndFacesOfAllSizes) {
  const ControlCage cage = parse(
      "v 0.5 -1.25e1 +3\nv 1 0 0 1.0\nv 1 1 0 0.1 0.2 0.3\nv 0 1 0\nv 2 2 2\n"
      "f 1 2 3\nf 1//1 2//1 3//1 4//1\nvn 0 0 1\nf 1 2 3 4 5\n");
  EXPECT_EQ(cage.points[0].x, 0.5);
  EXPECT_EQ(cage.points[0].y, -12.5);
  EXPECT_EQ(cage.points[0].z, 3);
  EXPECT_EQ(cage.face_vertex_counts, (std::vector<std::int32_t>{3, 4, 5}));
  EXPECT_EQ(cage.face_vertex_indices,
            (std::vector<std::int32_t>{0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4}));
  EXPECT_TRUE(cage.primvars.empty());
  EXPECT_TRUE(cage.notes.empty());
}

TEST(Obj, ReadsFacesOfMoreThan255Sides) {
  std::string text, face = "f";
  for (int i = 0; i < 1000; ++i) {
    text += "v " + std::to_string(i) + " 0 0\n";
    face += " " + std::to_string(i + 1);
  }
  EXPECT_EQ(parse(text + face + "\n").face_vertex_counts, std::vector<std::int32_t>{1000});
}

TEST(Obj, CountsRelativeIndicesBackFromTheirLine) {
  const ControlCage cage = parse(square + "f -4 -3 -2 -1\nv 5 5 5\nf -1 1 2\n");
  EXPECT_EQ(cage.face_vertex_indices, (std::vector<std::int32_t>{0, 1, 2, 3, 4, 0, 1}));
}

TEST(Obj, MakesOneCageOfGroupsObjectsAndMaterials) {
  const ControlCage cage =
      parse("mtllib none.mtl\no first\n" + square +
            "g a\nf 1 2 3\nt crease 2/1/0 0 1 2.5\nusemtl red\no second\nf 1 3 4\ng empty\n"
            "t hole 1/0/0 1\n");
  EXPECT_EQ(cage.face_count(), 2u);
  EXPECT_EQ(cage.crease_sharpnesses, std::vector<float>{2.5f});
  EXPECT_EQ(cage.hole_indices, std::vector<std::int32_t>{1});
}

TEST(Obj, ReadsEveryTag) {
  const ControlCage cage =
      parse(square +
            "f 1 2 3 4\nt crease 3/2/0 0 1 2 1.5 10\nt crease 3/1/0 2 3 0 4\n"
            "t corner 2/1/0 0 3 2\nt corner 1/1/0 1 0.5\nt interpolateboundary 1/0/0 2\n"
            "t facevaryinginterpolateboundary 1/0/0 5\nt creasemethod 0/0/1 chaikin\n"
            "t smoothtriangles 0/0/1 smooth\n");
  const auto edges = crease_edges(cage);
  ASSERT_EQ(edges.size(), 4u);
  EXPECT_EQ(edges[0].sharpness, 1.5f);
  EXPECT_EQ(edges[1].sharpness, 10.0f);
  EXPECT_EQ(edges[3].v0, 3);
  EXPECT_EQ(edges[3].v1, 0);
  EXPECT_EQ(edges[3].sharpness, 4.0f);
  EXPECT_EQ(cage.corner_indices, (std::vector<std::int32_t>{0, 3, 1}));
  EXPECT_EQ(cage.corner_sharpnesses, (std::vector<float>{2, 2, 0.5f}));
  EXPECT_EQ(cage.interpolate_boundary, InterpolateBoundary::edge_only);
  EXPECT_EQ(cage.face_varying_linear_interpolation, FaceVaryingLinearInterpolation::all);
  EXPECT_EQ(cage.creasing_method, CreasingMethod::chaikin);
  EXPECT_EQ(cage.triangle_subdivision_rule, TriangleSubdivisionRule::smooth);
  EXPECT_EQ(parse(square + "f 1 2 3\n").interpolate_boundary, InterpolateBoundary::edge_and_corner);
}

TEST(Obj, MakesTextureCoordinatesAPrimvar) {
  const std::string texture = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0.25 0.75 0\n";
  const ControlCage cage = parse(square + texture + "f 1/2 2/1 3/3 4/-1\n");
  ASSERT_EQ(cage.primvars.size(), 1u);
  EXPECT_EQ(cage.primvars[0].name, "st");
  EXPECT_EQ(cage.primvars[0].width, 2);
  EXPECT_EQ(cage.primvars[0].values, (std::vector<float>{0, 0, 1, 0, 1, 1, 0.25f, 0.75f}));
  EXPECT_EQ(cage.primvars[0].indices, (std::vector<std::int32_t>{1, 0, 2, 3}));
  const ControlCage mixed = parse(square + texture + "f 1/1 2/2 3\n");
  EXPECT_TRUE(mixed.primvars.empty());
  EXPECT_EQ(mixed.notes, std::vector<std::string>{
                             "model.obj: texture coordinates ignored: 1 face corners have none"});
}

TEST(Obj, JoinsLinesAndIgnoresCommentsAndLineEndings) {
  const ControlCage cage = parse("# a\r\n" + square + "f 1 2 \\\r\n3 4 # all\r\n#f 1 2 3\r\n\r\n");
  EXPECT_EQ(cage.face_vertex_counts, std::vector<std::int32_t>{4});
  EXPECT_EQ(complaint(square + "f 1 2 \\\n3\nf 1 2\n"),
            "model.obj:7: a face needs at least 3 corners, got 'f 1 2'");
}

TEST(Obj, RepairsDegenerateFacesWithANote) {
  const ControlCage cage = parse(square +
                                 "f 1 2 2 3\nf 1 1 2 2\nf 1 2 1 3\nf 1 3 4 1\n"
                                 "t hole 1/0/0 3\nt edgeedit 1/0/0 7\n");
  EXPECT_EQ(cage.face_vertex_counts, (std::vector<std::int32_t>{3, 3}));
  EXPECT_EQ(cage.face_vertex_indices, (std::vector<std::int32_t>{0, 1, 2, 0, 2, 3}));
  EXPECT_EQ(cage.hole_indices, std::vector<std::int32_t>{1});  // the fourth face of the file
  const std::vector<std::string> notes = {
      "model.obj:5: repeated vertex dropped from the face (and 1 more)",
      "model.obj:6: face dropped: it has fewer than 3 different vertices",
      "model.obj:7: face dropped: it meets a vertex again",
      "model.obj:10: unknown tag 'edgeedit' ignored"};
  EXPECT_EQ(cage.notes, notes);
  EXPECT_EQ(validate(cage).messages, notes);
}

struct Wrong {
  const char* text;  // after the four points of a square
  const char* message;
};

class WrongObj : public testing::TestWithParam<Wrong> {};

TEST_P(WrongObj, IsRefusedWithFileAndLine) {
  EXPECT_EQ(complaint(square + GetParam().text), std::string("model.obj:") + GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    Geometry, WrongObj,
    testing::Values(
        Wrong{"v 1 2\n", "5: a point needs at least 3 coordinates, got 'v 1 2'"},
        Wrong{"v 1 2 x\n", "5: not a finite number: 'x'"},
        Wrong{"v 1 2 3,5\n", "5: not a finite number: '3,5'"},
        Wrong{"v nan 0 0\n", "5: not a finite number: 'nan'"},
        Wrong{"v 0 inf 0\n", "5: not a finite number: 'inf'"},
        Wrong{"v 0 1e999 0\n", "5: not a finite number: '1e999'"},
        Wrong{"vt 0 -\n", "5: not a finite number: '-'"},
        Wrong{"\nf 1 2 9\n", "6: face index 9 is out of range [1, 4]"},
        Wrong{"f 1 2 0\n", "5: face index 0 is out of range [1, 4]"},
        Wrong{"f 1 2 -5\n", "5: face index -5 is out of range [-4, -1]"},
        Wrong{"f 1 2 3.5\n", "5: face index is not a whole number: '3.5'"},
        Wrong{"f 1 2 99999999999999999999\n",
              "5: face index is not a whole number: '99999999999999999999'"},
        Wrong{"f 1/1 2/1 3/1\n", "5: texture coordinate index 1 is out of range [1, 0]"},
        Wrong{"vt 0 0\nf 1/1 2/1 3/\n", "6: texture coordinate index is not a whole number: ''"},
        Wrong{"f 1//1 2//1 3//1\n", "5: normal index 1 is out of range [1, 0]"},
        Wrong{"f 1 2\n", "5: a face needs at least 3 corners, got 'f 1 2'"}));

INSTANTIATE_TEST_SUITE_P(
    Tags, WrongObj,
    testing::Values(
        Wrong{"t crease\n", "5: a tag needs a name and its sizes, got 't crease'"},
        Wrong{"t crease 2/1 0 1 2\n", "5: tag sizes must be ints/floats/strings, got '2/1'"},
        Wrong{"t crease 2/-1/0 0 1\n", "5: tag sizes must be ints/floats/strings, got '2/-1/0'"},
        Wrong{"t hole 9000/0/0 1\n",
              "5: a tag holds at most 8192 values of a kind, got '9000/0/0'"},
        Wrong{"t crease 2/1/0 0 1\n", "5: tag 'crease' must have 3 values, got 2"},
        Wrong{"t crease 2/1/0 0 b 2\n", "5: not a whole number: 'b'"},
        Wrong{"t crease 2/1/0 0 1 b\n", "5: not a finite number: 'b'"},
        Wrong{"t crease 1/1/0 0 2\n", "5: crease needs n >= 2 vertices and 1 or n - 1 sharpnesses"},
        Wrong{"t corner 2/3/0 0 1 1 1 1\n",
              "5: corner needs n >= 1 vertices and 1 or n sharpnesses"},
        Wrong{"t hole 0/0/0\n", "5: hole needs faces and nothing else"},
        Wrong{"t interpolateboundary 0/0/1 edge\n",
              "5: interpolateboundary needs one whole number"},
        Wrong{"t creasemethod 1/0/0 1\n", "5: creasemethod needs one word"},
        Wrong{"f 1 2 3 4\nt crease 2/1/0 0 2 1\n", "6: crease (0, 2) is no edge of the mesh"},
        Wrong{"f 1 2 3 4\nt crease 2/1/0 0 4 1\n", "6: tag vertex 4 is out of range [0, 3]"},
        Wrong{"f 1 2 3 4\nt crease 2/1/0 0 1 -1\n", "6: sharpness must be >= 0, got -1.000000"},
        Wrong{"f 1 2 3 4\nt corner 1/1/0 -1 1\n", "6: tag vertex -1 is out of range [0, 3]"},
        Wrong{"t hole 1/0/0 1\nf 1 2 3 4\n", "5: hole face 1 is out of range [0, 0]"},
        Wrong{"f 1 2 3 4\nt interpolateboundary 1/0/0 3\n",
              "6: interpolateboundary 3 is out of range [0, 2]"},
        Wrong{"f 1 2 3 4\nt creasemethod 0/0/1 soft\n",
              "6: creasemethod must be 'normal' or 'chaikin', got 'soft'"}));

TEST(Obj, NamesFilesThatCannotBeRead) {
  try {
    read_obj("no/such/file.obj");
    FAIL() << "read a file that does not exist";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "no/such/file.obj: cannot be read");
  }
  EXPECT_THROW(read_obj(LIMITRAY_TEST_CAGES), std::runtime_error);
}

TEST(Obj, ReadsEveryCageAndModelValidly) {
  const auto start = std::chrono::steady_clock::now();
  for (const auto& files : {test::cage_files(), test::model_files()}) {
    for (const auto& file : files) {
      const ControlCage cage = read_obj(file);
      EXPECT_GT(cage.face_count(), 0u) << file;
      EXPECT_NO_THROW(validate(cage)) << file;
    }
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_LT(seconds.count(), 10);
}

// The committed cages are what their script writes.
TEST(Cages, AreWhatTheirScriptWrites) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "limitray_cages";
  std::filesystem::create_directories(folder);
  const std::string command = "cd '" LIMITRAY_TEST_CAGES
                              "' && python3 -B -c 'import make_cages; "
                              "make_cages.write_all(\"" +
                              folder.string() + "\")'";
  if (std::system("python3 --version > /dev/null") != 0) GTEST_SKIP() << "no python3";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const auto text = [](const std::filesystem::path& file) {
    std::ifstream stream(file);
    return std::string{std::istreambuf_iterator<char>(stream), {}};
  };
  const auto written = test::obj_files(folder);
  EXPECT_EQ(written.size(), test::cage_files().size());
  for (const auto& file : written) {
    EXPECT_EQ(text(file), text(test::cage_file(file.stem().string()))) << file.filename();
  }
}

}  // namespace
}  // namespace limitray
