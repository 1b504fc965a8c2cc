#include "dynamic_slam/base/options.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::string_view kModes[] = {"offline", "realtime", "replay"};

struct InnerOptions {
  int features = 1000;
  double scale = 1.2;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("features", self.features, OptionField{"", 50, 20000, "Keypoints wanted."});
    visit("scale", self.scale, OptionField{"", 1.05, 2.0, "Scale between levels."});
  }
};

struct OuterOptions {
  uint64_t seed = 1;
  InnerOptions orb;
  bool quick = true;
  std::string note = "plain";
  double radius = 7.5;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("seed", self.seed, OptionField{"", 0, 0, "Seed of the random numbers."});
    visit("orb", self.orb);
    visit("quick", self.quick, OptionField{"", 0, 0, "Start quickly."});
    visit("note", self.note, OptionField{"", 0, 0, "Free text."});
    visit("radius", self.radius, OptionField{"px", 0, 100, "Search radius."});
  }
};

struct WordOptions {
  std::string mode = "offline";

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("mode", self.mode, OptionField{"", 0, 0, "How time passes.", kModes});
  }
};

class Options : public ::testing::Test {
 protected:
  // Writes `yaml` to a file, reads it and returns the error's message, or "".
  std::string Load(const std::string& yaml) {
    file_ = std::filesystem::path(::testing::TempDir()) /
            (std::string("dynamic_slam_options_") +
             ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".yaml");
    WriteFileAtomically(file_, yaml);
    try {
      LoadOptions(file_, &options_);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }

  std::string Set(const std::string& setting) {
    try {
      ApplySet(&options_, setting);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }

  std::filesystem::path file_;
  OuterOptions options_;
};

TEST_F(Options, CollectsDottedKeysInFieldOrder) {
  std::vector<std::string> keys;
  for (const OptionEntry& entry : CollectOptions(options_)) keys.push_back(entry.key);
  EXPECT_THAT(keys, ElementsAre("seed", "orb.features", "orb.scale", "quick", "note", "radius"));
}

TEST_F(Options, ReadsNestedMapsAndDottedKeysAndKeepsTheRest) {
  EXPECT_EQ(Load("orb:\n  features: 2000\norb.scale: 1.5\nquick: false\nnote: two words\n"), "");
  EXPECT_EQ(options_.orb.features, 2000);
  EXPECT_EQ(options_.orb.scale, 1.5);
  EXPECT_FALSE(options_.quick);
  EXPECT_EQ(options_.note, "two words");
  EXPECT_EQ(options_.radius, 7.5);
  EXPECT_EQ(Load(""), "");
  EXPECT_EQ(Load("orb:\n"), "");
}

TEST_F(Options, ReportsAllProblemsWithLinesAndChangesNothing) {
  const std::string error =
      Load("seed: 5\norb:\n  feautres: 10\n  scale: 3\nradius: wide\nquick: 1\nseed: 6\n");
  const std::string name = file_.string();
  EXPECT_THAT(error, HasSubstr("5 problems"));
  EXPECT_THAT(error, HasSubstr(name + ":3: unknown key 'orb.feautres'. Did you mean 'orb.features'?"));
  EXPECT_THAT(error, HasSubstr(name + ":4: orb.scale is 3, outside its range 1.05 to 2"));
  EXPECT_THAT(error, HasSubstr(name + ":5: radius must be a number, is 'wide'"));
  EXPECT_THAT(error, HasSubstr(name + ":6: quick must be true or false, is '1'"));
  EXPECT_THAT(error, HasSubstr(name + ":7: seed is given a second time, first in line 1"));
  EXPECT_EQ(options_.seed, 1u);
}

TEST_F(Options, ChecksTypes) {
  EXPECT_THAT(Load("orb:\n  features: 1000.5\n"), HasSubstr("must be a whole number"));
  EXPECT_THAT(Load("orb:\n  features: 99999999999\n"), HasSubstr("must be a whole number"));
  EXPECT_THAT(Load("seed: -1\n"), HasSubstr("not negative"));
  EXPECT_THAT(Load("radius: nan\n"), HasSubstr("not finite"));
  EXPECT_THAT(Load("radius: [1, 2]\n"), HasSubstr("must be a number"));
  EXPECT_THAT(Load("radius:\n"), HasSubstr("must be a number"));
  EXPECT_THAT(Load("orb: 3\n"), HasSubstr("orb is a section"));
  EXPECT_THAT(Load("features: 2000\n"), HasSubstr("Did you mean 'orb.features'?"));
  EXPECT_THAT(Load("zzz: 2000\n"), Not(HasSubstr("Did you mean")));
}

TEST_F(Options, NamesTheLineOfBrokenYaml) {
  const std::string error = Load("seed: 1\norb: [1, 2\n");
  EXPECT_THAT(error, HasSubstr("is not YAML"));
  EXPECT_THAT(error, HasSubstr(file_.string() + ":"));
  EXPECT_THAT(Load("- 1\n- 2\n"), HasSubstr("'key: value' lines are wanted"));
}

TEST_F(Options, MissingFileAndMissingKey) {
  EXPECT_THROW(LoadOptions("/no/such/file.yaml", &options_), InputError);
  Load("seed: 3\n");
  const std::string_view required[] = {"seed", "radius"};
  try {
    ReadYamlEntries(file_, CollectOptions(options_), required);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("the key 'radius' is missing"));
    EXPECT_THAT(e.what(), Not(HasSubstr("'seed'")));
  }
}

TEST_F(Options, SetsFromTheCommandLine) {
  EXPECT_EQ(Set("orb.features=40"),
            "--set: 1 problem\n  --set orb.features=40: orb.features is 40, outside its range "
            "50 to 20000\n  A run's config.yaml lists every key with its range.");
  EXPECT_EQ(Set("orb.features=400"), "");
  EXPECT_EQ(Set("note=a=b"), "");
  EXPECT_EQ(options_.orb.features, 400);
  EXPECT_EQ(options_.note, "a=b");
  EXPECT_THAT(Set("radius"), HasSubstr("write key=value"));
  EXPECT_THAT(Set("orb=3"), HasSubstr("orb is a section"));
  EXPECT_THAT(Set("radios=3"), HasSubstr("Did you mean 'radius'?"));
  const std::vector<std::string> two = {"seed=x", "radius=-1"};
  try {
    ApplySet(&options_, two);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("2 problems"));
  }
}

TEST_F(Options, WritesYamlWithComments) {
  EXPECT_EQ(OptionsToYaml(options_),
            "# Seed of the random numbers.\n"
            "seed: 1\n"
            "orb:\n"
            "  # Keypoints wanted. [50 to 20000]\n"
            "  features: 1000\n"
            "  # Scale between levels. [1.05 to 2]\n"
            "  scale: 1.2\n"
            "# Start quickly.\n"
            "quick: true\n"
            "# Free text.\n"
            "note: \"plain\"\n"
            "# Search radius. [0 to 100 px]\n"
            "radius: 7.5\n");
}

TEST_F(Options, WhatIsWrittenReadsBackIdentically) {
  OuterOptions written;
  written.seed = std::numeric_limits<uint64_t>::max();
  written.radius = 100.0 / 3.0;
  written.note = "a \"quoted\" \\ text: # with\nlines\tand \xC3\xA9";
  written.quick = false;
  written.orb.scale = 1.1;
  ASSERT_EQ(Load(OptionsToYaml(written)), "");
  EXPECT_EQ(options_.seed, written.seed);
  EXPECT_EQ(options_.radius, written.radius);
  EXPECT_EQ(options_.note, written.note);
  EXPECT_EQ(options_.quick, written.quick);
  EXPECT_EQ(options_.orb.scale, written.orb.scale);
  EXPECT_EQ(OptionsToYaml(options_), OptionsToYaml(written));
}

TEST_F(Options, ReturnsTheKeysThatAFileSetsInFieldOrder) {
  WriteFileAtomically(file_ = std::filesystem::path(::testing::TempDir()) / "dynamic_slam_options_keys.yaml",
                      "radius: 7.5\norb:\n  features: 60\n");
  EXPECT_THAT(LoadOptions(file_, &options_), ElementsAre("orb.features", "radius"));
}

TEST_F(Options, AWordMustBeInTheList) {
  WordOptions words;
  const auto error = [](const auto& function) -> std::string {
    try {
      function();
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(error([&] { ApplySet(&words, "mode=realtmie"); }),
              HasSubstr("mode must be offline, realtime or replay, is 'realtmie'. Did you mean 'realtime'?"));
  EXPECT_THAT(error([&] { ApplySet(&words, "mode="); }), HasSubstr("is ''."));
  EXPECT_EQ(words.mode, "offline");
  ApplySet(&words, "mode=replay");
  EXPECT_EQ(words.mode, "replay");
  CheckOptions(words);
  EXPECT_THAT(OptionsToYaml(words), HasSubstr("# How time passes. [offline, realtime or replay]\n"));
  words.mode = "other";
  EXPECT_THAT(error([&] { CheckOptions(words); }), HasSubstr("mode must be offline, realtime or replay"));

  const std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) / "dynamic_slam_options_words.yaml";
  WriteFileAtomically(file, "\nmode: often\n");
  EXPECT_THAT(error([&] { LoadOptions(file, &words); }),
              HasSubstr(file.string() + ":2: mode must be offline"));
}

TEST_F(Options, ExplainsAKeyOrASection) {
  const std::vector<OptionEntry> entries = CollectOptions(options_);
  EXPECT_EQ(ExplainEntries(entries, "radius"),
            "radius\n"
            "  Search radius.\n"
            "  a number: 0 to 100 px, default 7.5 px\n");
  EXPECT_EQ(ExplainEntries(entries, "orb"),
            "orb.features\n"
            "  Keypoints wanted.\n"
            "  a whole number: 50 to 20000, default 1000\n"
            "\n"
            "orb.scale\n"
            "  Scale between levels.\n"
            "  a number: 1.05 to 2, default 1.2\n");
  EXPECT_THAT(ExplainEntries(entries, "note"), HasSubstr("a text, default \"plain\"\n"));
  WordOptions words;
  EXPECT_THAT(ExplainEntries(CollectOptions(words), "mode"),
              HasSubstr("a text: offline, realtime or replay, default \"offline\"\n"));
  for (const auto& [wrong, suggestion] :
       {std::pair{"rob", "'orb'?"}, std::pair{"orb.scael", "'orb.scale'?"}}) {
    try {
      ExplainEntries(entries, wrong);
      FAIL() << wrong;
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr(std::string("Did you mean ") + suggestion));
    }
  }
  EXPECT_THROW(ExplainEntries(entries, "or"), InputError);  // not a section
  EXPECT_THROW(ExplainEntries(entries, ""), InputError);
}

TEST_F(Options, MarkdownHasATableForEachSection) {
  EXPECT_EQ(EntriesToMarkdown(CollectOptions(options_)),
            "## General\n\n"
            "| key | default | unit | range | what it does |\n|---|---|---|---|---|\n"
            "| `seed` | `1` |  | a whole number that is not negative | Seed of the random numbers. |\n"
            "| `quick` | `true` |  | true or false | Start quickly. |\n"
            "| `note` | `\"plain\"` |  | a text | Free text. |\n"
            "| `radius` | `7.5` | px | 0 to 100 | Search radius. |\n"
            "\n"
            "## `orb`\n\n"
            "| key | default | unit | range | what it does |\n|---|---|---|---|---|\n"
            "| `orb.features` | `1000` |  | 50 to 20000 | Keypoints wanted. |\n"
            "| `orb.scale` | `1.2` |  | 1.05 to 2 | Scale between levels. |\n");
  WordOptions words;
  EXPECT_THAT(EntriesToMarkdown(CollectOptions(words)), HasSubstr("| `offline`, `realtime` or `replay` |"));
}

TEST_F(Options, ChecksRangesOfValuesSetInCode) {
  EXPECT_NO_THROW(CheckOptions(options_));
  options_.orb.scale = 0;
  options_.radius = std::numeric_limits<double>::quiet_NaN();
  try {
    CheckOptions(options_);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("orb.scale is 0, outside"));
    EXPECT_THAT(e.what(), HasSubstr("radius is nan"));
  }
}

}  // namespace
}  // namespace dynamic_slam
