"""Pictures of runs: conversion of a log to a rerun recording, the viewer, screenshots without a screen."""
