// libFuzzer target: any bytes are an OBJ file that is read or refused with its name and, where the
// text is wrong, its line. What is read either passes `validate` or is refused by it.
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "limitray/cage/cage.h"
#include "limitray/cage/obj.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const limitray::ControlCage cage = limitray::parse_obj(text, "fuzz.obj");
    try {
      limitray::validate(cage);
    } catch (const std::invalid_argument&) {
      return 0;
    }
  } catch (const std::runtime_error& error) {
    if (std::string(error.what()).rfind("fuzz.obj:", 0) != 0) std::abort();
  }
  return 0;
}
