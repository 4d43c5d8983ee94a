// The cages that tests run over: the committed ones, and the optional models.
#pragma once

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace limitray::test {

/// All OBJ files below `folder`, sorted; none if it does not exist.
inline std::vector<std::filesystem::path> obj_files(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  if (!std::filesystem::is_directory(folder)) return files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".obj") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// The committed cage called `name`.
inline std::filesystem::path cage_file(const std::string& name) {
  return std::filesystem::path(LIMITRAY_TEST_CAGES) / (name + ".obj");
}

inline std::vector<std::filesystem::path> cage_files() { return obj_files(LIMITRAY_TEST_CAGES); }

/// The optional models in the folder LIMITRAY_MODELS; none if there is no such folder.
inline std::vector<std::filesystem::path> model_files() {
  const char* folder = std::getenv("LIMITRAY_MODELS");
  return obj_files(folder ? folder : LIMITRAY_SHARED_MODELS);
}

/// The committed cages, and the models of fewer than `bytes` bytes.
inline std::vector<std::filesystem::path> small_files(std::uintmax_t bytes) {
  std::vector<std::filesystem::path> files = cage_files();
  for (const auto& model : model_files())
    if (std::filesystem::file_size(model) < bytes) files.push_back(model);
  return files;
}

/// Name of a file as a test parameter: letters, digits and underscores.
inline std::string test_name(const std::filesystem::path& file) {
  std::string name = file.stem().string();
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
}

}  // namespace limitray::test
