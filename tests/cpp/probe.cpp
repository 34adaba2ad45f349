// What the tests ask include/sommerl.hpp. Files are loaded from a path, or from bytes on standard input.
//
//     probe call PATH NAME REAL CALL     rows of six numbers in double precision from standard input: f_r, densities or samples
//     probe codes                        files from standard input, each after its length (8 bytes): an error code for each
//     probe facts PATH NAME              metadata, one fact a line
#include "sommerl.hpp"

#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

template <class Brdf> Brdf opened(const std::string& path, const std::string& name) {
    return name.empty() ? Brdf::load(path) : Brdf::load(sommerl::Library::load(path), name);
}

template <class Real> int call(const std::string& path, const std::string& name, const std::string& call) {
    const auto brdf = opened<sommerl::BasicBrdf<Real>>(path, name);
    if (!brdf) return std::puts(sommerl::message(brdf.error())), 1;
    double in[6];
    while (std::fread(in, sizeof(double), 6, stdin) == 6) {
        const std::array<Real, 3> a{Real(in[0]), Real(in[1]), Real(in[2])}, b{Real(in[3]), Real(in[4]), Real(in[5])};
        std::array<Real, 3> wi{}, f_r{};
        Real pdf = 0;
        if (call == "eval") f_r = brdf.eval(a, b);
        if (call == "pdf") pdf = brdf.pdf(a, b);
        if (call == "sample") f_r = brdf.sample(a, b, &wi, &pdf);
        const double out[] = {f_r[0], f_r[1], f_r[2], wi[0], wi[1], wi[2], pdf, call == "sample" ? brdf.pdf(wi, a) : pdf};
        std::fwrite(out, sizeof(double), 8, stdout);
    }
    return 0;
}

/// Loads what may be anything, and asks what was loaded for some values. sampled: also for a sample, which takes longer.
sommerl::Error attempt(std::vector<std::uint8_t> bytes, bool sampled) {
    const auto ask = [sampled](const sommerl::Brdf& brdf) {
        std::array<float, 3> wi{}, weight{};
        float pdf = 0;
        const auto f_r = brdf.eval({0.6f, 0, 0.8f}, {0, 0.6f, 0.8f});
        if (sampled) weight = brdf.sample({0.6f, 0, 0.8f}, {0.5f, 0.25f, 0.75f}, &wi, &pdf);
        for (std::size_t i = 0; i < 3; ++i)
            if (!std::isfinite(f_r[i]) || !std::isfinite(weight[i]) || !std::isfinite(pdf)) std::abort();
        return brdf.error();
    };
    if (bytes.size() < 4 || std::memcmp(bytes.data(), "SMLB", 4) != 0) return ask(sommerl::Brdf::load(bytes.data(), bytes.size()));
    const auto library = sommerl::Library::load(std::move(bytes));
    sommerl::Error error = library.error();
    for (const auto& entry : library.entries()) {
        const sommerl::Error found = ask(sommerl::Brdf::load(library, entry.name));
        if (error == sommerl::Error::none) error = found;
    }
    return error;
}

int codes() {
    std::uint64_t length = 0;
    unsigned number = 0;
    while (std::fread(&length, 8, 1, stdin) == 1) {
        std::vector<std::uint8_t> bytes(static_cast<std::size_t>(length));
        if (length && std::fread(bytes.data(), 1, bytes.size(), stdin) != bytes.size()) return 1;
        std::fputc(static_cast<int>(attempt(std::move(bytes), number++ % 32 == 0)), stdout);
    }
    return 0;
}

int facts(const std::string& path, const std::string& name) {
    const auto brdf = opened<sommerl::Brdf>(path, name);
    std::printf("%s\n%s\n%s\n", brdf.name().c_str(), brdf.source_sha256().c_str(), brdf.notes().c_str());
    const int flags[] = {static_cast<int>(brdf.kind()), brdf.reciprocal(), brdf.mirrored(), brdf.is_signed(), brdf.trilinear()};
    for (const int flag : flags) std::printf("%d\n", flag);
    return brdf ? 0 : 1;
}

}  // namespace

int main(int count, char** arguments) {
    const std::vector<std::string> given(arguments, arguments + count);
    if (count == 2 && given[1] == "codes") return codes();
    if (count == 4 && given[1] == "facts") return facts(given[2], given[3]);
    if (count != 6) return 2;
    return given[4] == "float" ? call<float>(given[2], given[3], given[5]) : call<double>(given[2], given[3], given[5]);
}
