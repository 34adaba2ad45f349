// Arbitrary bytes for include/sommerl.hpp, with checksums put right, so that what lies behind them is reached. By .ci/fuzz.
#include "sommerl.hpp"

#include <cstdlib>

namespace {

using sommerl::detail::Bytes;

void put_right(std::vector<std::uint8_t>& bytes, std::size_t at, std::size_t from, std::size_t size) {
    if (from > bytes.size() || size > bytes.size() - from) return;
    const std::uint32_t crc = sommerl::detail::crc32(Bytes{bytes.data() + from, size});
    std::memcpy(bytes.data() + at, &crc, 4);
}

void put_right(std::vector<std::uint8_t>& bytes) {
    if (bytes.size() < 12) return;
    if (std::memcmp(bytes.data(), "SMLB", 4) != 0) return put_right(bytes, 6, 10, bytes.size() - 10);
    const std::size_t count = bytes[10];
    std::size_t place = 12 + 16 * count;
    for (std::size_t row = 12; row + 16 <= bytes.size() && row < 12 + 16 * count; row += 16) {
        std::uint32_t size = 0;
        std::memcpy(&size, bytes.data() + row + 4, 4);
        put_right(bytes, row + 12, place, size);
        place += size;
    }
    put_right(bytes, 6, 10, 2 + 16 * count);
}

void ask(const sommerl::Brdf& brdf) {
    static unsigned asked = 0;
    std::array<float, 3> wi{0.6f, 0, 0.8f}, weight{};
    float pdf = 0;
    if (asked++ % 16 == 0) weight = brdf.sample({0.6f, 0, 0.8f}, {0.5f, 0.25f, 0.75f}, &wi, &pdf);  // takes long at first
    const auto f_r = brdf.eval(wi, {0, 0.6f, 0.8f});
    for (std::size_t i = 0; i < 3; ++i)
        if (!std::isfinite(f_r[i]) || !std::isfinite(weight[i]) || !std::isfinite(pdf)) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::vector<std::uint8_t> bytes(data, data + size);
    put_right(bytes);
    ask(sommerl::Brdf::load(bytes.data(), bytes.size()));
    const auto library = sommerl::Library::load(std::move(bytes));
    for (const auto& entry : library.entries()) ask(sommerl::Brdf::load(library, entry.name));
    return 0;
}
